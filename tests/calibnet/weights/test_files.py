from __future__ import annotations

import ast
import json
import pickle
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

import calibnet
from calibnet.errors import WeightsError
from calibnet.geometry import RANGES
from calibnet.network.network import CalibrationNetwork
from calibnet.weights import load_network, read_record, save_network, weights_path
from tests.support.tiny import random_inputs, tiny_network

RECORD = {"minutes": 60.0, "seed": 1, "validation": None}


def saved(folder: Path, network: CalibrationNetwork | None = None) -> Path:
    network = network or tiny_network()
    path = folder / "tiny.safetensors"
    save_network(path, network, network.state_dict(), RECORD)
    return path


@pytest.mark.parametrize("share", [True, False])
@pytest.mark.parametrize("normalization", ["group", "batch"])
@pytest.mark.parametrize("head", ["geometric", "regression"])
def test_weights_come_back_to_half_precision(tmp_path: Path, share: bool, normalization: str, head: str) -> None:
    network = tiny_network(share_extractor=share, normalization=normalization, head=head, stage=4)
    loaded = load_network(saved(tmp_path, network))
    assert loaded.config == network.config and loaded.range == RANGES[3] and not loaded.training
    for name, tensor in network.state_dict().items():
        torch.testing.assert_close(loaded.state_dict()[name].to(tensor), tensor, rtol=1e-3, atol=1e-6)
    assert (loaded.features.image_trunk is loaded.features.lidar_trunk) == share
    inputs = random_inputs(network.config)
    with torch.inference_mode():
        torch.testing.assert_close(loaded(inputs).pose.correction, network(inputs).pose.correction, atol=5e-3, rtol=0)


def test_the_record_lies_in_the_header(tmp_path: Path) -> None:
    path = saved(tmp_path)
    assert read_record(path) == RECORD
    with safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["calib-inspect"])
    assert header["range"] == "5/0.5" and header["config"]["name"] == "tiny"
    assert all(tensor.dtype == torch.float16 for tensor in load_file(path).values())
    assert [entry.name for entry in tmp_path.iterdir()] == ["tiny.safetensors"], "no half-written file is left"


def test_names_of_weights_tell_preset_and_range(tmp_path: Path) -> None:
    assert weights_path("compact", RANGES[0], tmp_path) == tmp_path / "compact-20deg-1.5m.safetensors"
    assert weights_path("paper", RANGES[3]).parent == Path(calibnet.__file__).parent / "weights"


def assert_refused(path: Path, said: str) -> None:
    for read in (load_network, read_record):
        with pytest.raises(WeightsError, match=said) as raised:
            read(path)
        assert str(path) in str(raised.value) and "\n" not in str(raised.value)


def test_missing_weights_say_how_to_train_them(tmp_path: Path) -> None:
    assert_refused(tmp_path / "none.safetensors", "calib-inspect train")


@pytest.mark.parametrize("keep", [0, 4, 500, -1])
def test_truncated_weights_are_refused(tmp_path: Path, keep: int) -> None:
    path = saved(tmp_path)
    path.write_bytes(path.read_bytes()[:keep])
    assert_refused(path, "not a complete safetensors file")


def test_foreign_files_are_refused(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.safetensors"
    save_file({"weight": torch.zeros(2)}, foreign)
    assert_refused(foreign, "not written by calib-inspect")
    save_file({"weight": torch.zeros(2)}, foreign, metadata={"calib-inspect": "no json"})
    assert_refused(foreign, "header")
    save_file({"weight": torch.zeros(2)}, foreign, metadata={"calib-inspect": "{}"})
    assert_refused(foreign, "header")


class Mark:
    """Pickles to a call that leaves a trace."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return (Path.touch, (self.path,))


def test_pickles_are_refused_unopened(tmp_path: Path) -> None:
    path = tmp_path / "weights.safetensors"
    path.write_bytes(pickle.dumps(Mark(tmp_path / "opened")))
    assert_refused(path, "not a complete safetensors file")
    torch.save(tiny_network().state_dict(), path)
    assert_refused(path, "not a complete safetensors file")
    assert not (tmp_path / "opened").exists()


def test_weights_that_do_not_fit_their_config_are_refused(tmp_path: Path) -> None:
    network = tiny_network()
    path = tmp_path / "tiny.safetensors"
    for state in (
        {name: tensor for name, tensor in network.state_dict().items() if "pose" not in name and "score" not in name},
        network.state_dict() | {"more": torch.zeros(1)},
        {name: tensor[..., :1].contiguous() for name, tensor in network.state_dict().items()},
    ):
        save_network(path, network, state, RECORD)
        with pytest.raises(WeightsError, match="does not fit"):
            load_network(path)


def test_a_header_of_a_future_version_is_one_sentence(tmp_path: Path) -> None:
    path = saved(tmp_path)
    with safe_open(path, framework="pt") as file:
        header = json.loads(file.metadata()["calib-inspect"])
    header["config"]["attention"] = True
    save_file(load_file(path), path, metadata={"calib-inspect": json.dumps(header)})
    with pytest.raises(WeightsError, match=r"attention is unknown.*train it again") as raised:
        load_network(path)
    assert str(path) in str(raised.value)


def test_nothing_in_calibnet_unpickles() -> None:
    for source in Path(calibnet.__file__).parent.rglob("*.py"):
        tree = ast.parse(source.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                names = [alias.name for alias in node.names] + [getattr(node, "module", "") or ""]
                assert not {"pickle", "cPickle", "dill", "joblib", "cloudpickle"} & set(names), source
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("torch.load", "np.load", "numpy.load"):
                arguments = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
                assert ast.unparse(node.func) != "torch.load" and arguments.get("allow_pickle", "False") == "False", (
                    source
                )
