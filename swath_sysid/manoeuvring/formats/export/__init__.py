"""Exports of identified models: Gazebo, VRX, Nav2, Fossen's matrices."""
