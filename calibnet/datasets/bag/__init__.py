"""Bags: ROS 1, ROS 2 (sqlite3, MCAP) and MCAP of Foxglove, read without a ROS installation."""

from calibnet.datasets.bag.bag import Bag, BagOptions

__all__ = ["Bag", "BagOptions"]
