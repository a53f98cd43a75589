"""The rules of USD and glTF, as their own checkers have them."""

from __future__ import annotations

import json
import shutil
import subprocess

import pytest
from pxr import Usd, UsdValidation

from tests.interchange.conftest import ENVIRONMENT, require
from tests.interchange.scene import COUNT, FIRST, FPS

SCRIPT = """
const validator = require('gltf-validator'), fs = require('fs');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])), {maxIssues: 20})
  .then(report => console.log(JSON.stringify(report)), error => { console.error(error); process.exit(1); });
"""


@pytest.mark.parametrize("mesh", ["tracker", "full", "head"])
@pytest.mark.parametrize("file", ["corrected.usdc", "corrected_shapes.usdc"])
def test_usd_passes_the_rules_of_usdchecker(scene, mesh, file):
    rules = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(rules) > 20
    stage = Usd.Stage.Open(str(scene / mesh / file))
    found = UsdValidation.ValidationContext(rules).Validate(stage)
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in found] == []
    assert stage.GetFramesPerSecond() == stage.GetTimeCodesPerSecond() == FPS
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (FIRST, FIRST + COUNT - 1)


@pytest.mark.parametrize("mesh", ["tracker", "full", "head"])
def test_gltf_passes_the_khronos_validator(scene, mesh):
    modules = require(ENVIRONMENT / "node/node_modules/gltf-validator").parent
    node = shutil.which("node")
    assert node is not None
    done = subprocess.run(
        [node, "-e", SCRIPT, scene / mesh / "corrected.glb"], capture_output=True, text=True,
        env={"NODE_PATH": str(modules)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    issues = report["issues"]
    assert issues["numErrors"] == 0, issues["messages"]
    assert issues["numWarnings"] == 0, issues["messages"]
    assert report["info"]["animationCount"] == 1
