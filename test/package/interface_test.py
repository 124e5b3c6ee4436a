"""doc/interface.md against the code: parameters, topics, services and live parameters are the same on both sides."""
import re
import unittest

from checkout import CHECKOUT

PAGE = (CHECKOUT / 'doc/interface.md').read_text()
READ = re.compile(r'(\w+)\.(?:get|choice|number|integer|indices|list|raw|section)\(\s*"(\w+)"')
# What a function of monitor_config.cpp reads is below this name; the others read the root, or a body's own level.
SECTIONS = {'readTopology': 'topology/', 'readRigid': 'rigid/', 'readUncertainty': 'uncertainty/', 'topologySource': 'topology/',
            'readMarkers': 'markers/'}
# Where a page names a family at once.
ENTRY_FIELDS = {'between', 'separation_m'}  # of minimum_separation_pairs


def functions(text):
    """Name and body of each function that begins in the first column."""
    parts = re.split(r'(?m)^(?=[A-Za-z].*\) \{$)', text)
    for part in parts[1:]:
        yield re.search(r'(\w+)\(', part).group(1), part


def read_parameters():
    """Every parameter that the code asks for, bodies' own without their bodies/NAME/."""
    found = set()
    for name, body in functions((CHECKOUT / 'src/config/monitor_config.cpp').read_text()):
        for reader, parameter in READ.findall(body):
            prefix = 'marker/' if reader == 'marker' else SECTIONS.get(name, '')
            found.add(prefix + parameter)
        if 'separationOf(' in body:
            found.add('minimum_separation_m')
    return found - ENTRY_FIELDS


def expand(text):
    """`a/{b, c}` as a/b and a/c."""
    family = re.fullmatch(r'([\w/]+/)\{(.*)\}', text)
    return [family.group(1) + name.strip() for name in family.group(2).split(',')] if family else [text]


def page_parameters():
    table = PAGE[PAGE.index('## Parameters'):]
    found = set()
    for line in table[:table.index('Per body')].splitlines():
        if not line.startswith('| `'):
            continue
        prefix = ''
        for name in re.findall(r'`([^`]+)`', line.split('|')[1]):
            prefix = name[:name.rindex('/') + 1] if '/' in name else prefix
            found.add(name if '/' in name else prefix + name)
    paragraph = table[table.index('Per body'):]
    for code in re.findall(r'`([^`]+)`', paragraph[paragraph.index(':'):paragraph.index('\n\n')]):
        found.update(expand(code))
    return found


class InterfaceTest(unittest.TestCase):
    def test_parameters(self):
        code, page = read_parameters(), page_parameters()
        self.assertGreater(len(code), 50, 'the search found too little to mean anything')
        sections = {name[:-1] for name in SECTIONS.values()} | {'marker', 'effects', 'bodies', 'live'}
        explained = {'unknown_box'}  # in the row of unknown_space
        self.assertEqual(code - sections - explained, {name for name in page if not name.startswith('effects/')} -
                         {'stream', 'static'})

    def test_effects(self):
        source = (CHECKOUT / 'src/step/effect_plan.cpp').read_text()
        names = re.findall(r'\{"(\w+)", \w+\}', source[source.index('EFFECTS[] = {'):])
        row = next(line for line in PAGE.splitlines() if line.startswith('| `effects/NAME`'))
        self.assertEqual(sorted(re.findall(r'`(\w+)`', row.split('NAME:')[1])), sorted(names))

    def test_topics(self):
        code = set(re.findall(r'advertise<.*>\("(\w+)"', (CHECKOUT / 'src/output/outputs.cpp').read_text()))
        table = PAGE[PAGE.index('## What comes out'):PAGE.index('**How to read a contact.**')]
        rows = [line.split('|')[1] for line in table.splitlines() if line.startswith('| `')]
        self.assertEqual(code, {name for row in rows for name in re.findall(r'`~(\w+)`', row)})

    def test_services(self):
        source = (CHECKOUT / 'src/node/collision_monitor.cpp').read_text()
        source = source[source.index('::advertiseServices()'):]
        code = set(re.findall(r'advertise\("(\w+)"', source)) | set(re.findall(r'\(\s*"(\w+)", ', source[:3000])) & {'enable'}
        section = PAGE[PAGE.index('## Services'):PAGE.index('## Parameters')]
        self.assertGreaterEqual(len(code), 4)
        self.assertEqual(code, set(re.findall(r'(?:^|\. )`~(\w+)` \(', section, re.M)))

    def test_live_parameters(self):
        code = re.findall(r'gen\.add\("(\w+)"', (CHECKOUT / 'cfg/CollisionMonitor.cfg').read_text())
        paragraph = PAGE[PAGE.index('**While it runs**'):]
        listed = re.findall(r'`(\w+)`', paragraph[paragraph.index('):'):paragraph.index('\n\n')])
        self.assertEqual(sorted(listed), sorted(code))

    def test_live_limits(self):
        """A live set of one value sets all of them: narrower limits than the parameters' would clamp the others."""
        source = (CHECKOUT / 'src/config/monitor_config.cpp').read_text()
        limits = {}
        for name, least, most in re.findall(
                r'\.(?:number|integer)\(\s*"(\w+)", [^;]*?, ([-\w.]+), ([\w.]+)\)', source):
            limits[name] = (least, most)
        numbers = {'LARGE': 1e9, 'MANY': 1e9}
        live = re.findall(r'gen\.add\("(\w+)", (?:double|int)_t, 0, "[^"]*", [\w.-]+, ([\w.-]+), ([\w.-]+)\)',
                          (CHECKOUT / 'cfg/CollisionMonitor.cfg').read_text())
        self.assertEqual(len(live), 7, 'all but the accuracy and the switches')
        for name, *ends in live:
            expected = limits[name[len('marker_'):] if name.startswith('marker_') else name]
            for end, limit in zip(ends, expected):
                self.assertEqual(float(numbers.get(end, end)), float(numbers.get(limit, limit)), name)

    def test_monitor_yaml_holds_defaults_that_are_read(self):
        text = (CHECKOUT / 'config/monitor.yaml').read_text()
        names = set(re.findall(r'(?m)^(\w+):', text))
        self.assertLessEqual(names, read_parameters() | {'effects', 'markers'})


class LinksTest(unittest.TestCase):
    def test_no_link_is_dead(self):
        pages = [CHECKOUT / 'README.md'] + sorted((CHECKOUT / 'doc').glob('*.md'))
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
        for page in [CHECKOUT / 'README.md'] + sorted((CHECKOUT / 'doc').glob('*.md')):
            for name in re.findall(r'`((?:src|paper|oracle|test|include|config|launch|examples|scripts|doc|benchmark|msg|cmake)/[\w./-]*)`',
                                   page.read_text()):
                with self.subTest('%s: %s' % (page.name, name)):
                    self.assertTrue((CHECKOUT / name).exists())


if __name__ == '__main__':
    unittest.main()
