"""The parameters of the nodes: one table (parameters.yaml), and for each node the settings of the core from its values.
Only `declared` needs ROS. A node imports its own settings only, and so loads no more of the core than it runs.
"""
