"""Where the checkout is and what belongs to it; for the tests beside this file."""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
# Of the build under test: scripts/test --sanitize has a workspace of its own.
TOOLS = pathlib.Path(os.environ.get('DEFORMABLE_CCD_WORKSPACE', CHECKOUT / 'build')) / 'devel/lib/deformable_ccd'
CODE_SUFFIXES = {'.h', '.cpp'}
sys.path.append(str(CHECKOUT / 'scripts/lib'))  # ros_process


def run(*words, **more):
    """A program with all that it said."""
    return subprocess.run([str(word) for word in words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                          text=True, check=False, **more)


class FolderTestCase(unittest.TestCase):
    """With a folder of its own, as long as its tests last."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder, True)


def tracked_files():
    """Files of the checkout: git's where it is a clone, else all that is no build output."""
    listing = subprocess.run(['git', '-C', str(CHECKOUT), 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                             capture_output=True, text=True, check=False)
    if listing.returncode == 0:
        files = [CHECKOUT / name for name in listing.stdout.split('\0') if name]
    else:
        files = [p for p in CHECKOUT.rglob('*') if p.relative_to(CHECKOUT).parts[0] not in ('build', '.git')]
    return [p for p in files if p.is_file()]


def code_under(folder):
    return [p for p in sorted((CHECKOUT / folder).rglob('*')) if p.suffix in CODE_SUFFIXES]
