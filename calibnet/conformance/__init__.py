"""What every dataset, pose head and method keeps to, as functions that a test calls: ours, and that of a plugin.

Each raises ``AssertionError`` with one sentence about the first promise that is not kept::

    from calibnet.conformance import check_dataset

    def test_my_dataset_keeps_its_promises():
        check_dataset(lambda: MyDataset("tests/data"))

Export formats have theirs in `inspector.export.conformance`.
"""

from calibnet.conformance.dataset import check_dataset
from calibnet.conformance.head import check_head
from calibnet.conformance.method import check_method

__all__ = ["check_dataset", "check_head", "check_method"]
