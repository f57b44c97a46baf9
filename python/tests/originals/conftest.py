"""Settings of the tests in this folder, in effect before they are imported."""

import os

# dm_control without graphics: Mesa's drivers bring a version of LLVM that crashes with the one of Triton, which
# PyTorch imports in other tests of the same process.
os.environ["MUJOCO_GL"] = "disabled"
