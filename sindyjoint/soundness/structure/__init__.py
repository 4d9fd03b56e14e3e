"""A structure's sensors held against each other: through it they over-determine what moves it."""
