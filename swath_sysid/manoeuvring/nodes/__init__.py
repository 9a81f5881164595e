"""The nodes of the manoeuvring wing: they import rclpy."""
