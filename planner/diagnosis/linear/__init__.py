"""Fits of linear effects to FRFs, and the search among them."""
