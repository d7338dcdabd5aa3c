"""What the inventory refuses."""


class InventoryError(Exception):
    """A map or a list of trees cannot be used. The text says what is wrong, where, and what to do."""
