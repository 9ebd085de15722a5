"""Dynamics of hand and tool: virtual coupling, passivity, hands of studies and simulations."""
