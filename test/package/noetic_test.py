"""What ROS Noetic's system (Ubuntu 20.04) has: Python 3.8 and CMake 3.16. It cannot be had here; the code is held to the languages of these two.
What depends on a value's type, as | of two dicts, is not seen."""
import ast
import re
import unittest

from checkout import CHECKOUT, tracked_files

# Of Python 3.9 and later: modules, functions and methods that any object's may be called by, and keyword arguments of a function.
NEW_MODULES = {'graphlib', 'tomllib', 'zoneinfo'}
NEW_FUNCTIONS = {'ast.unparse', 'asyncio.TaskGroup', 'asyncio.timeout', 'asyncio.to_thread', 'contextlib.aclosing', 'contextlib.chdir', 'datetime.UTC',
                 'enum.StrEnum', 'functools.cache', 'hashlib.file_digest', 'importlib.resources.files', 'inspect.get_annotations', 'itertools.batched',
                 'itertools.pairwise', 'math.cbrt', 'math.exp2', 'math.lcm', 'math.nextafter', 'math.sumprod', 'math.ulp', 'operator.call',
                 'os.waitstatus_to_exitcode', 'random.randbytes', 're.NOFLAG', 'statistics.correlation', 'statistics.covariance',
                 'statistics.linear_regression', 'sys.exception', 'sys.orig_argv', 'sys.stdlib_module_names', 'typing.Annotated', 'typing.assert_never',
                 'typing.ParamSpec', 'typing.Self', 'typing.TypeAlias', 'argparse.BooleanOptionalAction'}
NEW_METHODS = {'assertNoLogs', 'bit_count', 'enterClassContext', 'enterContext', 'hardlink_to', 'is_junction', 'is_relative_to', 'readlink',
               'removeprefix', 'removesuffix', 'walk_up', 'with_segments', 'with_stem'}
NEW_KEYWORDS = {'zip': {'strict'}, 'dataclass': {'slots', 'kw_only'}, 'ArgumentParser': {'exit_on_error'}, 'TemporaryDirectory': {'ignore_cleanup_errors', 'delete'},
                'write_text': {'newline'}, 'bisect': {'key'}, 'bisect_left': {'key'}, 'bisect_right': {'key'}, 'insort': {'key'},
                'Popen': {'umask', 'user', 'group', 'process_group', 'pipesize'}, 'run': {'umask', 'user', 'group', 'process_group', 'pipesize'},
                'extractall': {'filter'}, 'rmtree': {'onexc'}, 'glob': {'root_dir', 'include_hidden'}, 'shutdown': {'cancel_futures'}}
GENERIC = {'list', 'dict', 'tuple', 'set', 'frozenset', 'type'}

# CMake's later commands and arguments, by what they look like. REQUIRED of find_library and find_path is not among them: 3.16 takes the word
# for one more place to look at, and ends the configuration all the same where what was not found is used.
NEW_CMAKE = [r'\bblock\s*\(', r'\bcmake_language\s*\(', r'\bcmake_path\s*\(', r'\bcmake_file_api\s*\(', r'\bstring\s*\(\s*(JSON|HEX)\b', r'\bZIP_LISTS\b',
             r'\bfile\s*\(\s*(ARCHIVE_CREATE|ARCHIVE_EXTRACT|CHMOD|CONFIGURE|COPY_FILE|REAL_PATH|RPATH_\w+)\b', r'\bCOMMAND_ERROR_IS_FATAL\b', r'\bFILE_SET\b',
             r'\breturn\s*\(\s*PROPAGATE\b', r'\bRUNTIME_DEPENDENCIES\b', r'\bRUNTIME_DEPENDENCY_SET\b', r'\bIMPORTED_RUNTIME_ARTIFACTS\b',
             r'\$<(TARGET_RUNTIME_DLLS|LINK_LIBRARY|LINK_GROUP|LINK_LANGUAGE|LINK_LANG_AND_ID|PATH|PATH_EQUAL|LIST|COMMAND_CONFIG|OUTPUT_CONFIG|BUILD_LOCAL_INTERFACE)\b',
             r'\bCMAKE_CURRENT_FUNCTION\w*\b', r'\bPROJECT_IS_TOP_LEVEL\b', r'\bDevelopment\.(Module|Embed|SABIModule)\b', r'\bFIND_PACKAGE_ARGS\b',
             r'\bcmake_minimum_required\s*\(VERSION\s+(?!3\.16\))']


def names_of(node):
    """`a.b.c` of an attribute or a name; empty of anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute):
        before = names_of(node.value)
        return before and before + '.' + node.attr
    return ''


def newer_than_3_8(text):
    """What of a Python program needs a later one than 3.8, in words."""
    try:
        tree = ast.parse(text, feature_version=(3, 8))
    except SyntaxError as error:
        return ['line %s: %s' % (error.lineno, error.msg)]
    found = []
    late = any(isinstance(node, ast.ImportFrom) and node.module == '__future__' and any(name.name == 'annotations' for name in node.names) for node in tree.body)
    annotations = {id(inner) for node in ast.walk(tree) for outer in (getattr(node, 'annotation', None), getattr(node, 'returns', None)) if outer is not None
                   for inner in ast.walk(outer)} if late else set()

    def tell(node, what):
        found.append('line %d: %s' % (node.lineno, what))

    for node in ast.walk(tree):
        if id(node) in annotations:
            continue
        if isinstance(node, ast.Import):
            for name in node.names:
                if name.name.split('.')[0] in NEW_MODULES:
                    tell(node, name.name)
        elif isinstance(node, ast.ImportFrom):
            for name in node.names:
                if node.module in NEW_MODULES or '%s.%s' % (node.module, name.name) in NEW_FUNCTIONS:
                    tell(node, '%s.%s' % (node.module, name.name))
        elif isinstance(node, ast.Attribute) and (names_of(node) in NEW_FUNCTIONS or node.attr in NEW_METHODS and not names_of(node).startswith('os.')):
            tell(node, names_of(node) or node.attr)
        elif isinstance(node, ast.Call):
            function = names_of(node.func).split('.')[-1] or getattr(node.func, 'attr', '')
            for keyword in node.keywords:
                if keyword.arg in NEW_KEYWORDS.get(function, ()):
                    tell(node, '%s(%s=…)' % (function, keyword.arg))
        elif isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id in GENERIC:
            tell(node, node.value.id + '[…]')
        elif isinstance(node, ast.With) and len(node.items) > 1 and text.splitlines()[node.lineno - 1].strip() in ('with (', 'async with ('):
            tell(node, 'a `with` in parentheses')
    return found


def python_files():
    for path in tracked_files():
        # A .pyi is for type checkers, and never run.
        if path.suffix == '.py' or (not path.suffix and path.read_bytes()[:40].startswith((b'#!/usr/bin/env python', b'#!/usr/bin/python'))):
            yield path


def newer_than_3_16(text):
    lines = [re.sub(r'(^|\s)#.*', '', line) for line in text.splitlines()]
    return ['line %d: %s' % (n, line.strip()) for n, line in enumerate(lines, 1) for pattern in NEW_CMAKE if re.search(pattern, line)]


class NoeticTest(unittest.TestCase):
    def test_python_of_3_8(self):
        files = list(python_files())
        self.assertGreater(len(files), 100)
        self.assertIn(CHECKOUT / 'scripts/pictures', files)
        wrong = {str(path.relative_to(CHECKOUT)): newer_than_3_8(path.read_text()) for path in files}
        self.assertEqual({name: found for name, found in wrong.items() if found}, {})

    def test_cmake_of_3_16(self):
        files = [path for path in tracked_files() if path.name == 'CMakeLists.txt' or path.suffix == '.cmake']
        self.assertGreater(len(files), 10)
        wrong = {str(path.relative_to(CHECKOUT)): newer_than_3_16(path.read_text()) for path in files}
        self.assertEqual({name: found for name, found in wrong.items() if found}, {})
        self.assertTrue((CHECKOUT / 'CMakeLists.txt').read_text().startswith('cmake_minimum_required(VERSION 3.16)\n'))

    def test_newer_python_is_seen(self):
        for text in ('match x:\n  case 1: pass', 'import tomllib', 'from zoneinfo import ZoneInfo', 'import functools\n@functools.cache\ndef f(): pass',
                     'from itertools import pairwise', '"a".removeprefix("b")', 'path.is_relative_to(other)', 'zip(a, b, strict=True)', 'x = list[int]()',
                     'def f(a: list[int]): pass', 'try:\n  pass\nexcept* ValueError:\n  pass', 'with (\n  open(a) as b,\n  open(c) as d,\n):\n  pass',
                     '@dataclasses.dataclass(slots=True)\nclass A: pass', 'import math\nmath.lcm(2, 3)'):
            self.assertNotEqual(newer_than_3_8(text), [], text)
        for text in ('from __future__ import annotations\ndef f(a: list[int]) -> dict[str, int]: pass', 'import os\nos.readlink(a)', 'zip(a, b)', 'x[list]',
                     'if (n := 3) > 2: pass', 'def f(a, /): pass'):
            self.assertEqual(newer_than_3_8(text), [], text)

    def test_newer_cmake_is_seen(self):
        for text in ('cmake_path(GET a FILENAME b)', 'string(JSON a GET ${b} c)', 'foreach(a b IN ZIP_LISTS c d)', 'file(COPY_FILE a b)', 'block()',
                     'cmake_minimum_required(VERSION 3.20)', 'find_package(Python3 COMPONENTS Development.Module)', 'x $<PATH:GET_FILENAME,a>'):
            self.assertNotEqual(newer_than_3_16(text), [], text)
        self.assertEqual(newer_than_3_16('# cmake_path(\ncmake_minimum_required(VERSION 3.16)\nfile(GLOB a CONFIGURE_DEPENDS *.cpp)'), [])


if __name__ == '__main__':
    unittest.main()
