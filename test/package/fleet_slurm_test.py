"""analyze_fleet --slurm on a real Slurm."""
import collections
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time
import unittest

from checkout import TOOLS, FolderTestCase, run
from fleet_support import TABLES, make_scene, rows_of

LONG = bool(os.environ.get('DEFORMABLE_CCD_LONG'))
SLURM = '''ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
CryptoType=crypto/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
SlurmctldPort={ports[0]}
SlurmdPort={ports[1]}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=8000 State=UNKNOWN
PartitionName=test Nodes={host} Default=YES State=UP
'''


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    for one in sockets:
        one.bind(('127.0.0.1', 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


@unittest.skipUnless(LONG, 'a cluster of its own takes minutes; scripts/test --long')
class SlurmTest(FolderTestCase):
    """On a real Slurm: one node on loopback, without slurmdbd and without USER."""

    @classmethod
    def setUpClass(cls):
        missing = [tool for tool in ('snakemake', 'slurmctld', 'slurmd', 'munged', 'sbatch') if shutil.which(tool) is None]
        if missing:
            raise unittest.SkipTest('no ' + ', '.join(missing))
        if os.getuid() != 0:
            raise unittest.SkipTest('Slurm is started by root')
        super().setUpClass()
        cls.folder.chmod(0o755)
        host = socket.gethostname().split('.')[0]
        (cls.folder / 'munge.key').write_bytes(os.urandom(1024))
        (cls.folder / 'munge.key').chmod(0o400)
        config = cls.folder / 'slurm.conf'
        config.write_text(SLURM.format(host=host, folder=cls.folder, ports=free_ports(2)))
        cls.environment = {k: v for k, v in os.environ.items() if k not in ('USER', 'LOGNAME')}
        cls.environment['SLURM_CONF'] = str(config)
        cls.start('munged', '--foreground', '--force', '--key-file', cls.folder / 'munge.key', '--socket', cls.folder / 'munge.socket',
                  '--pid-file', cls.folder / 'munge.pid', '--log-file', cls.folder / 'munge.log', '--seed-file', cls.folder / 'seed')
        (cls.folder / 'spool').mkdir()
        (cls.folder / 'state').mkdir()
        cls.start('slurmctld', '-D', '-f', config)
        cls.start('slurmd', '-D', '-f', config, '-N', host)
        end = time.time() + 30
        while run('srun', '-t', '1', 'true', env={**cls.environment, 'SLURM_WAIT': '1'}).returncode != 0:
            if time.time() > end:
                raise unittest.SkipTest('Slurm does not start here: ' + cls.log()[-600:])
            time.sleep(0.5)

    @classmethod
    def start(cls, *words):
        output = open(cls.folder / (words[0] + '.out'), 'w')
        process = subprocess.Popen([str(w) for w in words], env=cls.environment, stdout=output, stderr=subprocess.STDOUT)
        cls.addClassCleanup(output.close)
        cls.addClassCleanup(process.wait)
        cls.addClassCleanup(process.terminate)
        return process

    @classmethod
    def log(cls):
        return '\n'.join(path.read_text(errors='replace') for path in sorted(cls.folder.glob('*.out')))

    def test_twelve_recordings(self):
        """Of two scenes, one of them corrupt, one worker killed in the middle."""
        made = [make_scene(self.folder, 'scene_%d' % i, ('table_edge', 'flag_in_wind')[i % 2], '--frames', 25 + i, '--seed', i)
                for i in range(11)]
        params = self.folder / 'all.yaml'
        params.write_text('max_step_s: 0.5\n')
        corrupt = self.folder / 'corrupt.bag'
        corrupt.write_bytes(made[0][0].read_bytes()[:20000])
        bags = [bag for bag, _ in made] + [corrupt]
        out = self.folder / 'results'
        words = [str(w) for w in ('/usr/bin/python3', TOOLS / 'analyze_fleet', *bags, '--params', params, '--out', out, '--slurm',
                                  '--jobs', 4)]
        with open(self.folder / 'fleet.err', 'w+') as said:
            process = subprocess.Popen(words, env=self.environment, stdout=subprocess.DEVNULL, stderr=said)
            killed = self.kill_a_worker(process)
            self.assertEqual(process.wait(timeout=1500), 4)
            said.seek(0)
            text = said.read()
        self.assertTrue(killed)
        self.assertIn('analyze_fleet: corrupt: ', text)
        states = collections.Counter(state for state, in rows_of(out, 'SELECT state FROM recordings'))
        self.assertEqual(sum(states.values()), 12)
        self.assertEqual((states['failed'], states['missing']), (1, 1), (states, text))
        again = run(*words, env=self.environment)
        states = collections.Counter(state for state, in rows_of(out, 'SELECT state FROM recordings'))
        self.assertEqual((states['failed'], states['missing']), (1, 0), (states, again.stderr))
        whole = self.folder / 'whole'
        for bag, _ in made[:3]:
            run(TOOLS / 'analyze_bag', bag, '--report', whole, '--quiet', '--params', params)
            for table in TABLES:
                self.assertEqual((out / 'recordings' / bag.stem / 'report' / table).read_bytes(), (whole / table).read_bytes(), table)

    def kill_a_worker(self, process):
        """An analyze_bag that Slurm has started, once some are done."""
        while process.poll() is None:
            if len(list((self.folder / 'results').glob('recordings/*/result.json'))) > 3:
                for pid in filter(str.isdigit, os.listdir('/proc')):
                    try:
                        command = pathlib.Path('/proc', pid, 'cmdline').read_bytes().split(b'\0')
                        if command[0].endswith(b'/analyze_bag') and any(str(self.folder).encode() in word for word in command):
                            os.kill(int(pid), signal.SIGKILL)
                            return True
                    except (OSError, IndexError):
                        continue
            time.sleep(0.002)
        return False


if __name__ == '__main__':
    unittest.main()
