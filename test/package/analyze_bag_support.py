"""A recorded scene and its analysis; for the tests of analyze_bag."""
import collections

from bag_messages import messages_of, write_bag
from checkout import CHECKOUT, TOOLS, FolderTestCase, run

OWN = '/collision_monitor/'


class AnalyzeBagTestCase(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.bag = cls.folder / 'scene.bag'
        cls.tool('make_scene_bag', CHECKOUT / 'config/scenes/table_edge.yaml', cls.bag, '--frames', 40, '--quiet')
        cls.messages = messages_of(cls.bag)
        cls.cloths = [message for message in cls.messages if message[0] == '/cloth']
        cls.plain = cls.analyze('plain', cls.bag)

    @classmethod
    def tool(cls, name, *words):
        ran = run(TOOLS / name, *words)
        assert ran.returncode == 0, ran.stderr
        return ran

    @classmethod
    def analyze(cls, name, bag, *words):
        """The folder of the report, which has the contacts of some steps."""
        report = cls.folder / name
        cls.tool('analyze_bag', bag, '--report', report, '--quiet', *words)
        return report

    def analyzed(self, name, bag, *words):
        """Exit status, standard output and error, and the statuses of the steps; whatever comes of it."""
        report = self.folder / name
        ran = run(TOOLS / 'analyze_bag', bag, '--report', report, '--quiet', *words)
        self.assertIn(ran.returncode, (0, 3), ran.stderr)
        self.said = ran.stdout
        return ran.returncode, ran.stdout, ran.stderr, self.statuses_of(report)

    def params(self, text):
        path = self.folder / 'given.yaml'
        path.write_text('fixed_frame: world\n' + text)
        return ['--params', path]

    def bag_with(self, name, *maps):
        """The scene's cloth and, at the bag's beginning, other messages: (topic, message)."""
        start = self.messages[0][2]
        return self.write(name, [(topic, message, start) for topic, message in maps] + self.cloths)

    def write(self, name, messages):
        return write_bag(self.folder / name, messages)

    def refused(self, bag, *words):
        ran = run(TOOLS / 'analyze_bag', bag, '--report', self.folder / 'no', '--quiet', *words)
        self.assertEqual(ran.returncode, 1, ran.stdout)
        return ran.stderr

    def octomap(self):
        return next(message for topic, message, _ in self.messages if topic == '/octomap_binary')

    def statuses(self, bag):
        return self.analyzed('statuses', bag, *self.params('max_step_s: 1.0\n'))[-1]

    @staticmethod
    def statuses_of(report):
        steps = [line.split(',') for line in (report / 'steps.csv').read_text().splitlines()]
        return collections.Counter(row[steps[0].index('status')] for row in steps[1:])

    @staticmethod
    def rows_of(path):
        """Without the columns that say when something came, and when it was told."""
        rows = [line.split(',') for line in path.read_text().splitlines()]
        kept = [i for i, name in enumerate(rows[0]) if name not in ('told_ns', 'map_stamp_ns', 'map_came_ns')]
        return [[row[i] for i in kept if i < len(row)] for row in rows]

    def expect_same(self, report, names=('contacts.csv', 'steps.csv')):
        for name in names:
            expected = self.rows_of(self.plain / name)
            self.assertGreater(len(expected), 20, 'too little to mean anything')
            self.assertEqual(self.rows_of(report / name), expected, name)
