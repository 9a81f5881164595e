"""The nodes: declare, convert, delegate, publish. The only room that imports rclpy and message packages."""
