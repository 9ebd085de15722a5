"""The web server of the page: panels, uploads, who may connect."""
