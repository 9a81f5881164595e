"""The page at the tank side: what is seen and pressed in a browser.

It knows no ROS: what it shows comes from a `Source`, and what is pressed goes to it.
"""
