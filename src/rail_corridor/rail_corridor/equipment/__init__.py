"""One folder per kind of equipment, and the registry that knows them."""
