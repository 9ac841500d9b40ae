"""Who may ask what, how often and how much: in front of the HTTP interface."""
