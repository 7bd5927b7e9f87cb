"""The build step of the package: protoc and grpc_python_plugin write `calib/v1` from `proto/calib/v1`."""

import pathlib
import shutil
import subprocess

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.errors import SetupError

PROTO = pathlib.Path(__file__).resolve().parents[2] / "proto"


class BuildWithStubs(build_py):
    """Messages (`_pb2.py` with types in `_pb2.pyi`) and stubs (`_pb2_grpc.py`) beside the package's own files."""

    def run(self) -> None:
        super().run()
        plugin = shutil.which("grpc_python_plugin")
        if plugin is None or shutil.which("protoc") is None:
            raise SetupError("protoc and grpc_python_plugin are needed: Debian's protobuf-compiler and protobuf-compiler-grpc")
        if not PROTO.is_dir():
            raise SetupError(f"{PROTO} is not there: the package is built from a clone of the repository")
        out = pathlib.Path(self.build_lib)
        sources = sorted(str(path.relative_to(PROTO)) for path in (PROTO / "calib" / "v1").glob("*.proto"))
        subprocess.run(
            ["protoc", f"-I{PROTO}", f"--plugin=protoc-gen-grpc={plugin}", f"--python_out={out}", f"--pyi_out={out}",
             f"--grpc_out={out}", *sources],
            check=True)
        (out / "calib" / "v1" / "__init__.py").write_text('"""Messages and stubs of the service, written by protoc."""\n')


setup(cmdclass={"build_py": BuildWithStubs})
