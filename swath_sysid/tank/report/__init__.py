"""Tables, figures and pages of the tank wing."""
