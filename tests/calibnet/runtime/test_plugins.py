"""What other packages register is found, is loaded only when it is asked for, and breaks nothing."""

from __future__ import annotations

import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from calibnet.errors import ConfigError
from calibnet.methods.learned.networks import NETWORKS
from calibnet.runtime.plugins import Registry, package_at_fault, plugins
from tests.support.toy_package import install, install_toys

DATASETS = Registry("datasets", "dataset", {"folder": "calibnet.datasets.folder:Folder"})


@pytest.fixture(autouse=True)
def toys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install_toys(tmp_path, monkeypatch)


def test_names_are_found_without_an_import() -> None:
    assert set(plugins("datasets")) == {"toy", "folder", "broken"}
    assert DATASETS.names() == ("folder", "broken", "toy")
    assert "toy" in DATASETS and "tay" not in DATASETS
    assert "toy_package" not in sys.modules


def test_entry_points_that_cannot_be_read_hide_no_others(tmp_path: Path) -> None:
    install(tmp_path, "a_package", "", "[calib_inspect.datasets]\nnothing but words\n")
    with pytest.raises(TypeError):
        entry_points(group="calib_inspect.datasets")
    assert DATASETS.names() == ("folder", "broken", "toy")


def test_what_has_the_name_is_imported() -> None:
    assert DATASETS.load("toy").__name__ == "Frames"
    assert sys.modules["toy_package"].Frames is DATASETS.load("toy")


def test_our_own_names_cannot_be_taken() -> None:
    assert DATASETS.load("folder").__module__ == "calibnet.datasets.folder"


def test_a_broken_package_is_one_sentence() -> None:
    with pytest.raises(ConfigError) as refused:
        DATASETS.load("broken")
    assert str(refused.value) == (
        "The dataset 'broken' of package broken_package cannot be imported "
        "(ModuleNotFoundError: No module named 'no_such_library_of_its'); update the package or uninstall it."
    )


def test_an_unknown_name_lists_those_there_are() -> None:
    with pytest.raises(ConfigError, match="'tay' is not a dataset; choose from folder, broken, toy"):
        DATASETS.load("tay")


def test_a_network_of_another_package_is_a_plugin_as_its_method_is(tmp_path: Path) -> None:
    code = "def net():\n    raise ValueError('no layers')\n"
    install(tmp_path, "their_networks", code, "[calib_inspect.networks]\nnet = their_networks:net\n")
    with pytest.raises(ValueError, match="no layers") as raised:
        NETWORKS.load("net")()
    assert package_at_fault(raised.value) == "their_networks"
