"""The web server of the page: panels, uploads, access control."""
