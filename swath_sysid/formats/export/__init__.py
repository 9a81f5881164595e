"""Identified models in the words of simulators and controllers: Gazebo, VRX, Nav2, Fossen's matrices."""
