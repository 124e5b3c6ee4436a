"""doc/interface.md against the code: parameters, topics, services and live parameters are the same on both sides."""
import re
import unittest
import xml.etree.ElementTree as ElementTree

from checkout import CHECKOUT, tracked_files

PAGE = (CHECKOUT / 'doc/interface.md').read_text()
ALL_PAGES = sorted(CHECKOUT.glob('*.md')) + sorted((CHECKOUT / 'doc').glob('*.md'))
READ = re.compile(r'(\w+)\.(?:get|frame|choice|number|integer|indices|list|raw|sections?)\(\s*"(\w+)"')
CONFIG = ''.join(re.sub(r'choiceOf\((\w+), ', r'\1.choice(', path.read_text()) for path in sorted((CHECKOUT / 'src/config').glob('*.cpp')))
# What a function of src/config reads is below this name; the others read the root, or a body's own level.
SECTIONS = {'readTopology': 'topology/', 'readRigid': 'rigid/', 'readUncertainty': 'uncertainty/',
            'readDepthImage': 'topology/',
            'readSpeedLaw': 'speed_scale/', 'readIntent': 'intent/', 'readApproachLimits': 'limits/', 'readMarkers': 'markers/', 'readClearance': 'clearance/',
            'readRobotParameters': 'robot/'}
# Where a page names a family at once.
# These read the fields of an entry of a list, which the list's own row explains.
ENTRIES = {'readCloudSource', 'readSeparationPair', 'readPartners', 'readExpectation', 'readLink'}


def functions(text):
    """Name and body of each function that begins in the first column."""
    parts = re.split(r'(?m)^(?=[A-Za-z].*\) \{$)', text)
    for part in parts[1:]:
        yield re.search(r'(\w+)\(', part).group(1), part


def read_parameters():
    """Every parameter that the code asks for, bodies' own without their bodies/NAME/."""
    found = set()
    for name, body in functions(CONFIG):
        for reader, parameter in [] if name in ENTRIES else READ.findall(body):
            prefix = 'marker/' if reader == 'marker' else SECTIONS.get(name, '')
            found.add(prefix + parameter)
        if 'separationOf(' in body:
            found.add('minimum_separation_m')
        if 'ownVoxelsOf(section' in body:
            found.add(SECTIONS.get(name, '') + 'own_voxels_m')
        if 'speedBoundOf(section' in body:
            found.add(SECTIONS.get(name, '') + 'max_speed_m_s')
    return found


def names_of(line):
    """The parameters of a row, `a/b`, `c` as a/b and a/c; none of a line that is no such row."""
    found, prefix = [], ''
    for name in re.findall(r'`([^`]+)`', line.split('|')[1] if line.startswith('| `') else ''):
        prefix = name[:name.rindex('/') + 1] if '/' in name else prefix
        found.append(name if '/' in name else prefix + name)
    return found


def numbers_of_bodies():
    """The parameters of a body that the code reads as a number with a fraction."""
    found = set()
    for name, body in functions(CONFIG[:CONFIG.index('void readSeparationPair(')]):
        found |= {SECTIONS.get(name, '') + parameter for parameter in re.findall(r'\.number\(\s*"(\w+)"', body)}
    return found


def page_parameters():
    table = PAGE[PAGE.index('## Parameters'):]
    return {name for line in table[:table.index('### Time and memory')].splitlines() for name in names_of(line)}


def body_parameters():
    """Of each row of the table of per-body parameters: the names, and the units, one for all names or one for each."""
    table = PAGE[PAGE.index('Per body, as'):PAGE.index('### Time and memory')]
    for line in table.splitlines():
        names = names_of(line)
        if names:
            units = line.split(' | ')[2].strip().split(', ')
            yield from zip(names, units if len(units) > 1 else units * len(names))


class InterfaceTest(unittest.TestCase):
    def test_parameters(self):
        code, page = read_parameters(), page_parameters()
        self.assertGreater(len(code), 50, 'the search found too little to mean anything')
        sections = {name[:-1] for name in SECTIONS.values()} | {'marker', 'effects', 'bodies', 'live'}
        explained = {'unknown_box'}  # in the row of unknown_space
        self.assertEqual(code - sections - explained, {name for name in page if not name.startswith('effects/')})
        self.assertLessEqual(len(code - sections), 95, 'what has one right value is no parameter')

    def test_units_of_a_bodys_parameters(self):
        """Metres where a name says so; what the code reads as a real number, and only that, has metres or metres per unit.

        InterfacePage in test/unit/ros/interface_page_test.cpp holds the defaults, through the node's own reader."""
        units = dict(body_parameters())
        self.assertGreater(len(units), 20, 'the search found too little to mean anything')
        self.assertEqual({name for name, unit in units.items() if unit == 'm'}, {n for n in units if n.endswith('_m')})
        numbers = numbers_of_bodies()
        self.assertEqual(numbers, {'minimum_separation_m', 'own_voxels_m', 'uncertainty/radius_m', 'rigid/scale',
                                   'topology/max_edge_m', 'topology/max_range_m', 'max_speed_m_s', 'max_acceleration_m_s2',
                                   'max_relative_speed_m_s'})
        self.assertEqual({name for name, unit in units.items() if re.match(r'm\b', unit)}, numbers)

    def test_effects(self):
        names = re.findall(r'  ROW\(\w+, (\w+)\)', (CHECKOUT / 'include/dccd/outcome.h').read_text())
        self.assertGreater(len(names), 5)
        row = next(line for line in PAGE.splitlines() if line.startswith('| `effects/NAME`'))
        self.assertEqual(sorted(re.findall(r'`(\w+)`', row.split('NAME:')[1])), sorted(names))

    def test_counters_of_a_step(self):
        """The rows of the code's table and the message's fields."""
        names = re.findall(r'  COUNTER\((\w+), ', (CHECKOUT / 'include/dccd/outcome.h').read_text())
        self.assertGreater(len(names), 10, 'the search found too little to mean anything')
        fields = re.findall(r'(?m)^uint\d+ (\w+)', (CHECKOUT / 'msg/StepStats.msg').read_text())
        self.assertEqual([name for name in names if fields.count(name) != 1], [])

    def test_topics(self):
        code = {topic for source in ('output/outputs.cpp', 'node/state_reporter.cpp')
                for topic in re.findall(r'advertise<.*>\("(\w+)"', (CHECKOUT / 'src' / source).read_text())}
        table = PAGE[PAGE.index('## What comes out'):PAGE.index('### How to read a contact')]
        rows = [line.split('|')[1] for line in table.splitlines() if line.startswith('| `')]
        self.assertEqual(code, {name for row in rows for name in re.findall(r'`~(\w+)`', row)})

    def test_curves_of_the_layout(self):
        """What config/plotjuggler.xml plots is a number of a message that is published under that topic."""
        types = {topic: name for source in ('output/outputs.cpp', 'node/state_reporter.cpp')
                 for name, topic in re.findall(r'advertise<(?:\w+::)*(\w+)>\("(\w+)"', (CHECKOUT / 'src' / source).read_text())}
        curves = [curve.get('name') for curve in ElementTree.parse(CHECKOUT / 'config/plotjuggler.xml').iter('curve')]
        self.assertGreater(len(curves), 10)
        for curve in curves:
            _, node, topic, field, *inner = curve.split('/')
            with self.subTest(curve):
                self.assertEqual(node, 'collision_monitor')
                if types[topic] == 'Bool':
                    self.assertEqual(field, 'data')
                else:
                    message = (CHECKOUT / 'msg' / (types[topic] + '.msg')).read_text()
                    if inner:  # of an item of an array
                        kind, = re.findall(r'(?m)^(\w+)\[\d+\] %s\b' % field.split('[')[0], message)
                        message, field = (CHECKOUT / 'msg' / (kind + '.msg')).read_text(), inner[0]
                    self.assertRegex(message, r'(?m)^(u?int|float)\d+ %s\b' % field)

    def test_services(self):
        source = (CHECKOUT / 'src/node/monitor_services.cpp').read_text()
        code = set(re.findall(r'advertise<\w+>\(service, "(\w+)"', source))
        section = PAGE[PAGE.index('## Services'):PAGE.index('## Parameters')]
        self.assertGreaterEqual(len(code), 5)
        self.assertEqual(code, set(re.findall(r'(?:^|\. )`~(\w+)` \(', section, re.M)))

    def test_live_parameters(self):
        code = re.findall(r'gen\.add\("(\w+)"', (CHECKOUT / 'cfg/CollisionMonitor.cfg').read_text())
        paragraph = PAGE[PAGE.index('### While it runs'):]
        listed = re.findall(r'`(\w+)`', paragraph[:paragraph.index('\n\n')])
        self.assertEqual(sorted(listed), sorted(code))

    def test_live_limits(self):
        """A live set of one value sets all of them: narrower limits than the parameters' would clamp the others."""
        source = CONFIG
        limits = {}
        for name, least, most in re.findall(
                r'\.(?:number|integer)\(\s*"(\w+)", [^;]*?, ([-\w.]+), ([\w.]+)\)', source):
            limits[name] = (least, most)
        numbers = {'LARGE': 1e9, 'MANY': 1e9}
        live = re.findall(r'gen\.add\("(\w+)", (?:double|int)_t, 0, "[^"]*", [\w.-]+, ([\w.-]+), ([\w.-]+)\)',
                          (CHECKOUT / 'cfg/CollisionMonitor.cfg').read_text())
        self.assertEqual(len(live), 6, 'all but the accuracy and the switches')
        for name, *ends in live:
            expected = limits[name[len('marker_'):] if name.startswith('marker_') else name]
            for end, limit in zip(ends, expected):
                self.assertEqual(float(numbers.get(end, end)), float(numbers.get(limit, limit)), name)

    def test_live_defaults(self):
        """What dynamic_reconfigure shows before it has heard of the node, and what its own server falls back on."""
        live = re.findall(r'gen\.add\("(\w+)", (?:double|int)_t, 0, "[^"]*", ([\w.-]+),', (CHECKOUT / 'cfg/CollisionMonitor.cfg').read_text())
        self.assertEqual(len(live), 6, 'all but the accuracy and the switches')
        table = PAGE[PAGE.index('## Parameters'):PAGE.index('Per body, as')]
        page = {name: default for line in table.splitlines() if names_of(line)
                for name, default in zip(names_of(line), line.split(' | ')[1].split(', '))}
        for name, default in live:
            named = name.replace('marker_', 'markers/', 1)
            self.assertEqual(float(default), float(page[named].split()[0]), name)

    def test_monitor_yaml_holds_defaults_that_are_read(self):
        text = (CHECKOUT / 'config/monitor.yaml').read_text()
        names = set(re.findall(r'(?m)^(\w+):', text))
        self.assertLessEqual(names, read_parameters() | {'effects', 'markers'})


class LinksTest(unittest.TestCase):
    def test_no_link_is_dead(self):
        pages = ALL_PAGES
        count = 0
        for page in pages:
            for target in re.findall(r'\]\(([^)\s]+)\)', page.read_text()):
                if '://' in target:
                    continue
                path, _, anchor = target.partition('#')
                count += 1
                to = (page.parent / path).resolve() if path else page
                with self.subTest('%s: %s' % (page.name, target)):
                    self.assertTrue(to.exists())
                    if anchor:
                        heads = re.findall(r'(?m)^#+ (.*)$', to.read_text())
                        slugs = [re.sub(r'[^\w\- ]', '', head.lower()).replace(' ', '-') for head in heads]
                        self.assertIn(anchor, slugs)
        self.assertGreater(count, 10)

    def test_files_that_pages_name_exist(self):
        """`src/…`, `test/…` and the like, in the pages' code words."""
        for page in ALL_PAGES:
            for name in re.findall(r'`((?:src|paper|oracle|test|include|config|launch|examples|scripts|doc|benchmark|msg|cmake)/[\w./-]*)`',
                                   page.read_text()):
                with self.subTest('%s: %s' % (page.name, name)):
                    self.assertTrue((CHECKOUT / name).exists())

    def test_no_address_is_invented(self):
        """The one in package.xml, which its format asks for, says itself that it is none."""
        for path in tracked_files():
            if path.suffix in ('.md', '.cff', '.yml', '.rst'):
                self.assertEqual(re.findall(r'[\w.+-]+@[\w-]+\.[a-z]{2,}\b', path.read_text()), [], path)
        self.assertIn('private reporting', (CHECKOUT / 'SECURITY.md').read_text())


if __name__ == '__main__':
    unittest.main()
