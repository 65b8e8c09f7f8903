"""Builds the wheel for `pip install ./python` (PEP 517) with CMake and Python's own library, so that nothing is fetched.

Debian 12 has no scikit-build-core. The extension is built in a folder of its own, or, with
`--config-settings build=FOLDER` or RTSG_BUILD, in a build folder that is there already.
Run as a program, it writes what an installed package says of itself (rtsg-VERSION.dist-info) into the given folder.
"""
import base64
import hashlib
import os
import pathlib
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

try:
    import tomllib
except ImportError:  # before 3.11
    from pip._vendor import tomli as tomllib

HERE = pathlib.Path(__file__).resolve().parent
LEFT_OUT = ("TESTS", "BENCH", "WEB", "WINDOW")


def get_requires_for_build_wheel(config_settings=None):
    return []


def build_sdist(sdist_directory, config_settings=None):
    raise RuntimeError("the sources of the package are the whole repository, whose archive git makes; a wheel is built from a checkout")


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Returns the wheel's name."""
    with tempfile.TemporaryDirectory() as folder:
        installed = pathlib.Path(folder) / "installed"
        build = (config_settings or {}).get("build") or os.environ.get("RTSG_BUILD")
        if not build:
            build = os.path.join(folder, "build")
            configure(build)
        run("cmake", "--build", build, "--target", "rtsg_python", "--parallel")
        run("cmake", "--install", build, "--component", "python", "--prefix", installed, "--strip")
        files = {path.relative_to(installed).as_posix(): path.read_bytes() for path in sorted(installed.rglob("*")) if path.is_file()}
    for path in sorted((HERE / "rtsg").iterdir()):
        if path.suffix in (".py", ".pyi") or path.name == "py.typed":
            files[f"rtsg/{path.name}"] = path.read_bytes()
    version = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return write_wheel(pathlib.Path(wheel_directory), project(), files, version, sysconfig.get_platform().replace("-", "_").replace(".", "_"))


def configure(build):
    generator = ["-G", "Ninja"] if subprocess.run(["ninja", "--version"], capture_output=True, check=False).returncode == 0 else []
    run("cmake", "-S", HERE.parent, "-B", build, *generator, "-DCMAKE_BUILD_TYPE=Release", "-DRTSG_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}",
        *[f"-DRTSG_{part}=OFF" for part in LEFT_OUT])


def run(*command):
    try:
        subprocess.run([str(word) for word in command], check=True, stdout=sys.stderr)
    except FileNotFoundError:
        raise RuntimeError(f"{command[0]} is not installed: ./dev names the packages that a build takes") from None


def project():
    return tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def dist_info(about):
    """The files, by name, that say what is installed, of the project that pyproject.toml names."""
    metadata = [f"Metadata-Version: 2.1\nName: {about['name']}\nVersion: {about['version']}\nSummary: {about['description']}",
                f"License: {about['license']['text']}", f"Requires-Python: {about['requires-python']}"]
    metadata += [f"Requires-Dist: {need}" for need in about["dependencies"]]
    for extra, needs in about.get("optional-dependencies", {}).items():
        metadata += [f"Provides-Extra: {extra}"] + [f"Requires-Dist: {need} ; extra == '{extra}'" for need in needs]
    points = "".join(f"[{group}]\n" + "".join(f"{name} = {target}\n" for name, target in names.items())
                     for group, names in about.get("entry-points", {}).items())
    folder = f"{about['name']}-{about['version']}.dist-info"
    return folder, {"METADATA": "\n".join(metadata) + "\n", "entry_points.txt": points}


def write_wheel(folder, about, files, version, machine):
    tag = f"{version}-{version}-{machine}"
    info, texts = dist_info(about)
    texts["WHEEL"] = f"Wheel-Version: 1.0\nGenerator: rtsg\nRoot-Is-Purelib: false\nTag: {tag}\n"
    files = {**files, **{f"{info}/{name}": text.encode() for name, text in texts.items()}}
    name = f"{about['name']}-{about['version']}-{tag}.whl"
    with zipfile.ZipFile(folder / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        def add(path, data):
            entry = zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0))  # the same wheel of the same files
            entry.external_attr = (0o755 if ".so" in path else 0o644) << 16
            wheel.writestr(entry, data, zipfile.ZIP_DEFLATED)

        record = []
        for path, data in files.items():
            add(path, data)
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            record.append(f"{path},sha256={digest},{len(data)}")
        add(f"{info}/RECORD", "\n".join([*record, f"{info}/RECORD,,"]) + "\n")
    return name


if __name__ == "__main__":
    name, texts = dist_info(project())
    (pathlib.Path(sys.argv[1]) / name).mkdir(parents=True)
    for file, text in texts.items():
        (pathlib.Path(sys.argv[1]) / name / file).write_text(text, encoding="utf-8")
