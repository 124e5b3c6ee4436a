#!/usr/bin/env python3
"""Packs the module dccd of a build folder, and the libraries that it loads, as a wheel.

The libraries lie beside the module, under names of their own, so that no other library of a program takes their place. What
every system has stays out: the libraries of C and C++. scripts/wheel calls this:

    make_wheel.py BUILD_FOLDER WHERE
"""
import base64
import hashlib
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import zipfile

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
# Of the C library and the compiler; each Linux that the wheel's tag names has them.
OF_THE_SYSTEM = re.compile(r'(linux-vdso|ld-linux.*|libc|libm|libstdc\+\+|libgcc_s|libpthread|libdl|librt)\.so')


def run(*words):
    return subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, check=True, text=True).stdout


def loaded_by(module):
    """Name -> file of the libraries that the loader would take, but for the system's."""
    libraries = {}
    for line in run('ldd', module).splitlines():
        name, _, rest = line.strip().partition(' => ')
        if OF_THE_SYSTEM.match(name.split(' ')[0].split('/')[-1]):
            continue
        path = rest.split(' (')[0]
        if not os.path.isabs(path):
            sys.exit('make_wheel: %s loads %s, which is not there' % (module.name, name))
        libraries[name] = pathlib.Path(os.path.realpath(path))
    return libraries


def licences(libraries):
    """Name in the wheel -> file: ours, and that of each library that goes with it."""
    found = {'LICENSE': CHECKOUT / 'LICENSE'}
    for name, path in libraries.items():
        if path.name.startswith('libdeformable_ccd.so'):
            continue
        # Debian's list names a file as it was packaged, which may be below / instead of /usr.
        for spelling in (str(path), re.sub('^/usr', '', str(path))):
            said = subprocess.run(['dpkg-query', '-S', spelling], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False)
            if said.returncode == 0:
                package = said.stdout.split(':')[0]
                found[package] = pathlib.Path('/usr/share/doc') / package / 'copyright'
                break
        else:
            sys.exit('make_wheel: no package owns %s: whose licence is it under?' % path)
    # What scripts/setup --from-source built is within our own library.
    if not any(name.startswith('libhwy.so') for name in libraries):
        sources = [path for depth in ('', '*/') for path in (CHECKOUT / 'build/dependencies/source/highway').glob(depth + 'LICENSE*')]
        if not sources:
            sys.exit('make_wheel: no licence of Highway in build/dependencies/source, though it is within the library')
        found.update(('highway-' + path.name, path) for path in sources)
    return found


def put_together(tree, folder):
    """The files of the wheel, in `folder`."""
    suffix = sysconfig.get_config_var('EXT_SUFFIX')
    module = pathlib.Path(tree) / 'python_module' / ('_dccd' + suffix)
    metadata = module.parent / 'METADATA'
    if not module.is_file() or not metadata.is_file():
        sys.exit('make_wheel: %s is not there: build the target deformable_ccd_python for %s' % (module, sys.executable))
    libraries = loaded_by(module)
    package = folder / 'dccd'
    shutil.copytree(str(CHECKOUT / 'python/dccd'), str(package), ignore=shutil.ignore_patterns('__pycache__'))
    names = {}
    for name, path in libraries.items():
        digest = hashlib.sha256(path.read_bytes()).hexdigest()[:8]
        names[name] = name.replace('.so', '-%s.so' % digest, 1)
        shutil.copy(str(path), str(package / names[name]))
    shutil.copy(str(module), str(package / module.name))
    for file in [package / module.name] + [package / name for name in names.values()]:
        file.chmod(0o755)
        run('strip', '--strip-unneeded', file)  # before patchelf: not after it
        needed = run('patchelf', '--print-needed', file).split()
        for name in needed:
            if name in names:
                run('patchelf', '--replace-needed', name, names[name], file)
            elif not OF_THE_SYSTEM.match(name):
                sys.exit('make_wheel: %s needs %s, which ldd did not name' % (file.name, name))
        if file.name != module.name:
            run('patchelf', '--set-soname', file.name, file)
        run('patchelf', '--set-rpath', '$ORIGIN', file)
    text = metadata.read_text()
    version = re.search(r'(?m)^Version: (.*)$', text).group(1)
    info = folder / ('dccd-%s.dist-info' % version)
    (info / 'licenses').mkdir(parents=True)
    for name, path in licences(libraries).items():
        shutil.copy(str(path), str(info / 'licenses' / name))
    (info / 'METADATA').write_text(text)
    # Whatever was linked here asks for no newer C library than this system's; systems as new have a C++ library as new.
    python = 'cp%d%d' % sys.version_info[:2]
    libc, glibc = platform.libc_ver()
    assert libc == 'glibc', libc
    tag = '%s-%s-manylinux_%s_%s' % (python, python, glibc.replace('.', '_'), platform.machine())
    (info / 'WHEEL').write_text('Wheel-Version: 1.0\nGenerator: deformable_ccd\nRoot-Is-Purelib: false\nTag: %s\n' % tag)
    return 'dccd-%s-%s.whl' % (version, tag), info


def pack(folder, info, path):
    """Zips `folder`, with the list of what is in it."""
    rows = []
    with zipfile.ZipFile(str(path), 'w', zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(p for p in folder.rglob('*') if p.is_file()):
            name, data = file.relative_to(folder).as_posix(), file.read_bytes()
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b'=').decode()
            rows.append('%s,sha256=%s,%d' % (name, digest, len(data)))
            entry = zipfile.ZipInfo(name)  # of 1980: equal files make an equal wheel
            entry.external_attr = (0o100755 if '.so' in file.name else 0o100644) << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, data)
        record = '%s/RECORD' % info.name
        entry = zipfile.ZipInfo(record)
        entry.external_attr = 0o100644 << 16
        archive.writestr(entry, '\n'.join(rows + [record + ',,']) + '\n')


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    tree, where = sys.argv[1], pathlib.Path(sys.argv[2])
    missing = [program for program in ('ldd', 'strip', 'patchelf') if not shutil.which(program)]
    if missing:
        sys.exit('make_wheel: %s is not installed; run scripts/setup --wheel' % ', '.join(missing))
    where.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        name, info = put_together(tree, pathlib.Path(folder))
        pack(pathlib.Path(folder), info, where / name)
    print(where / name)


if __name__ == '__main__':
    main()
