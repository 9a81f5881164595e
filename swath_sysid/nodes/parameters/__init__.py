"""The parameters of the nodes: one table a node, and the settings of the core that its values make.

Only `declared` needs ROS: the same tables make the nodes' declarations, the configuration file and the documentation.
A node imports its own table only, and so loads no more of the core than it runs.
"""
