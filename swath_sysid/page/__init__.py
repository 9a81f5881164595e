"""The page in the browser: what is shown and the buttons. It knows no ROS: a `Source` supplies the data and carries out
the requests.
"""
