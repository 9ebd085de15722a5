"""Answers of people from elsewhere: tables read by a mapping of columns, and models beside them."""
