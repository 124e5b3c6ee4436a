#!/usr/bin/env python3
"""A bare Debian root made by mmdebstrap: the machine of somebody who has installed nothing yet.

Packages that a developer has installed hide what scripts/setup forgets; a root with nothing but a minimal Debian and git
cannot be fooled like that. As a program it copies the checkout into such a root and runs one command of it there:

    bare_root.py --release trixie -- scripts/test
"""
import argparse
import contextlib
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

CHECKOUT = pathlib.Path(__file__).resolve().parents[2]
RELEASES = ('bookworm', 'trixie', 'bullseye')
# Where the copy lies in the root.
INSIDE = '/srv/stranger/deformable_ccd'
# What a login shell of a fresh machine has. IN_BARE_ROOT keeps scripts/test from making a root inside the root.
ENVIRONMENT = {'HOME': '/srv/stranger', 'PATH': '/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin',
               'TERM': 'dumb', 'LANG': 'C.UTF-8', 'DEFORMABLE_CCD_IN_BARE_ROOT': '1'}


class CannotMake(Exception):
    """Why there can be no bare root here, in words."""


def host_release():
    text = pathlib.Path('/etc/os-release').read_text()
    found = re.search(r'^VERSION_CODENAME=(\w+)', text, re.M)
    return found.group(1) if found else ''


def source_entries(folder=pathlib.Path('/etc/apt')):
    """(URI, suite) of each entry of this machine's own apt sources that offers packages of the component main."""
    entries = []
    for path in [folder / 'sources.list'] + sorted((folder / 'sources.list.d').glob('*')):
        text = path.read_text() if path.is_file() else ''
        if path.suffix == '.list':
            for line in text.splitlines():
                found = re.match(r'deb\s+(?:\[[^]]*\]\s+)?(\S+)\s+(\S+)\s+(.*)', line)
                if found and 'main' in found.group(3).split():
                    entries.append((found.group(1), found.group(2)))
        elif path.suffix == '.sources':
            for paragraph in re.split(r'\n\s*\n', text):
                fields = dict(re.findall(r'^([\w-]+):[ \t]*(.*)', paragraph, re.M))
                if 'deb' in fields.get('Types', '').split() and 'main' in fields.get('Components', '').split():
                    entries += [(uri, suite) for uri in fields['URIs'].split() for suite in fields['Suites'].split()]
    return entries


def sources_of(release, entries, host):
    """The lines of a sources.list for `release`, from where this machine has its own."""
    own = [(uri, suite[len(host):]) for uri, suite in entries if host and re.fullmatch(host + r'(-\w+)?', suite)]
    if not own:
        raise CannotMake("this machine's apt sources do not name its own release %r" % host)
    # Of another release only the main suite: what its updates and security list may have gone from this server.
    return ['deb %s %s%s main' % (uri, release, suffix) for uri, suffix in own if release == host or not suffix]


def checkout_files():
    """What a clone of the working tree as it is now would hold, relative to the checkout."""
    listing = subprocess.run(['git', '-C', str(CHECKOUT), 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                             capture_output=True, check=False)
    if listing.returncode == 0:
        names = [name for name in listing.stdout.decode().split('\0') if name]
        return [name for name in names if os.path.lexists(CHECKOUT / name)]
    return [str(p.relative_to(CHECKOUT)) for p in CHECKOUT.rglob('*')
            if p.is_file() and p.relative_to(CHECKOUT).parts[0] not in ('build', '.git')]


class BareRoot:
    def __init__(self, folder, release):
        self.folder, self.release = pathlib.Path(folder), release

    def make(self, include=('--include=git,ca-certificates',)):
        """Raises CannotMake with a reason where this machine cannot."""
        if os.geteuid() != 0:
            raise CannotMake('only root makes a bare root')
        for program in ('mmdebstrap', 'unshare', 'chroot'):
            if not shutil.which(program):
                raise CannotMake('%s is not installed' % program)
        lines = sources_of(self.release, source_entries(), host_release())
        made = subprocess.run(['mmdebstrap', '--quiet', '--mode=root', '--variant=minbase', *include,
                               self.release, str(self.folder), '-'], input='\n'.join(lines) + '\n', text=True,
                              capture_output=True, check=False)
        if made.returncode != 0:
            said = (made.stderr.strip().splitlines() or ['no word'])[-1]
            raise CannotMake('mmdebstrap made no root of %s: %s' % (self.release, said))
        shutil.copy('/etc/resolv.conf', self.folder / 'etc/resolv.conf')
        # Every installer and every container runtime writes it; mmdebstrap does not.
        (self.folder / 'etc/hosts').write_text('127.0.0.1 localhost\n::1 localhost ip6-localhost\n')
        for path in pathlib.Path('/etc/apt/apt.conf.d').glob('*'):
            if 'proxy' in path.read_text(errors='replace').lower():
                shutil.copy(path, self.folder / 'etc/apt/apt.conf.d')
        # A root that is thrown away need not survive a power cut; Debian's container images say so, too.
        (self.folder / 'etc/dpkg/dpkg.cfg.d/unsafe-io').write_text('force-unsafe-io\n')
        # Nor need modules be compiled that nobody imports, which takes longer than to unpack them; what is imported compiles then.
        for name in ('py3compile', 'py3clean'):
            subprocess.run(['dpkg-divert', '--root', str(self.folder), '--quiet', '--no-rename', '--add', '/usr/bin/' + name], check=True)
            (self.folder / 'usr/bin' / name).symlink_to('/bin/true')  # Debian 11 has it there alone
        if self.run('true').returncode != 0:
            raise CannotMake('this machine may not mount /proc for a root')

    def path(self, name=''):
        """Where a file of the copy lies, seen from outside."""
        return pathlib.Path(str(self.folder) + INSIDE) / name

    def copy_checkout(self):
        target = self.path()
        target.mkdir(parents=True, exist_ok=True)
        for name in checkout_files():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(CHECKOUT / name, target / name, follow_symlinks=False)
        # A clone: whatever asks git gets an answer.
        self.run('git init --quiet . && git add --all', check=True)
        data = CHECKOUT.parent / 'shared'
        if data.exists():  # beside the checkout, as it is here
            (target.parent / 'shared').mkdir(exist_ok=True)

    def run(self, command, **more):
        """Runs the shell line in the copy of the checkout, in a process namespace that ends all it has started."""
        root = str(self.folder)
        mounts = ['mount -t proc proc "$0/proc"', 'mount -t tmpfs tmpfs "$0/dev/shm"',
                  # Terminals of its own: a test looks at a tool's screen through one.
                  'mount -t devpts -o newinstance,ptmxmode=0666 devpts "$0/dev/pts"', 'mount --bind "$0/dev/pts/ptmx" "$0/dev/ptmx"',
                  '{ [ ! -d "$1" ] || mount --bind -o ro "$(realpath "$1")" "$0%s"; }' % (os.path.dirname(INSIDE) + '/shared'),
                  'cd /', 'exec chroot "$0" /bin/bash -c "$2"']
        # A master's port of its own: this machine may have one running.
        environment = dict(ENVIRONMENT, **more.pop('environment', {}))
        inside = 'mkdir -p %s && cd %s && %s' % (INSIDE, INSIDE, command)
        return subprocess.run(['unshare', '--mount', '--pid', '--fork', '--kill-child', 'sh', '-ec', ' && '.join(mounts), root,
                               str(CHECKOUT.parent / 'shared') if (self.folder / 'srv/stranger/shared').is_dir() else '',
                               inside], env=environment, stdin=subprocess.DEVNULL, **more)


@contextlib.contextmanager
def bare_root(release):
    """A made root with the checkout in it; gone afterwards. DEFORMABLE_CCD_ROOTS names another folder for it than /tmp."""
    place = os.environ.get('DEFORMABLE_CCD_ROOTS') or tempfile.gettempdir()
    with tempfile.TemporaryDirectory(prefix='deformable_ccd_%s_' % release, dir=place) as folder:
        root = BareRoot(pathlib.Path(folder) / 'root', release)
        root.make()
        root.copy_checkout()
        yield root


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--release', default='bookworm', choices=RELEASES)
    parser.add_argument('command', nargs='+', help='run by a shell in the copy of the checkout')
    arguments = parser.parse_args()
    try:
        with bare_root(arguments.release) as root:
            return root.run(' '.join(arguments.command)).returncode
    except CannotMake as why:
        print('bare_root: %s' % why, file=sys.stderr)
        return 77


if __name__ == '__main__':
    sys.exit(main())
