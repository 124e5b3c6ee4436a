"""The report's page in a real browser: it draws what it promises, reports no error, and asks for nothing from anywhere."""
import csv
import json
import re
import shutil
import unittest

import yaml

from checkout import CHECKOUT, TOOLS, FolderTestCase, run

try:
    from selenium import webdriver
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
except ImportError:  # as chromium-driver, only where somebody installed it
    webdriver = None

SCENES = CHECKOUT / 'config/scenes'
BROWSER = next((b for b in ('chromium', 'chromium-browser', 'google-chrome') if shutil.which(b)), None)


def report(folder, scene, frames, *words):
    """The page of a scene's report."""
    bag, params = folder / 'scene.bag', folder / 'scene.yaml'
    for command in ([TOOLS / 'make_scene_bag', scene, bag, '--frames', frames, '--monitor-config', params, '--quiet'],
                    [TOOLS / 'analyze_bag', bag, '--params', params, '--report', folder, '--quiet', *words]):
        ran = run(*command)
        if ran.returncode not in (0, 3):  # 3: not all of it is proved
            raise RuntimeError(ran.stderr)
    return folder / 'report.html'


class ReportPageTest(FolderTestCase):
    @classmethod
    def setUpClass(cls):
        """The report that most of them read."""
        super().setUpClass()
        cls.page = report(cls.folder, SCENES / 'table_edge.yaml', 80, '--accuracy-study')

    def setUp(self):
        self.own = self.folder / self._testMethodName
        self.own.mkdir()

    def report(self, *arguments):
        self.page = report(self.own, *arguments)

    def changed(self, change):
        """A report of the same scene after a change of its page."""
        page = yaml.safe_load((SCENES / 'table_edge.yaml').read_text())
        change(page)
        scene = self.own / 'changed.yaml'
        scene.write_text(yaml.safe_dump(page))
        self.report(scene, 40)

    def dom(self):
        """The page as a browser leaves it, and what its console said."""
        ran = run(BROWSER, '--headless', '--no-sandbox', '--disable-gpu', '--enable-logging=stderr', '--v=0',
                  '--user-data-dir=%s' % (self.own / 'profile'), '--dump-dom', self.page.as_uri(), timeout=120)
        return ran.stdout[:ran.stdout.index('<script')], ran.stderr

    def test_loads_nothing(self):
        text = self.page.read_text()
        self.assertIn("default-src 'none'", text)
        text = re.sub(r'<script id="three">.*?</script>', '', text, flags=re.S)  # the library names sites and loads none
        addresses = set(re.findall(r'https?://[^\s\'"]+', text)) - {'http://www.w3.org/2000/svg'}
        self.assertEqual(addresses, set())
        self.assertNotRegex(text, r'<(?:link|img|iframe)\b|<script[^>]*\bsrc=|@import|\burl\(')

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_draws_in_a_browser(self):
        body, console = self.dom()
        self.assertNotRegex(console, r'CONSOLE.*(?:Error|error)')
        for name, least in (('contacts', 10), ('study_plot', 15)):
            drawn = body[body.index('id="%s"' % name):].split('</svg>')[0]
            self.assertGreater(len(re.findall(r'<(?:rect|circle)\b', drawn)), least, name)
        self.assertIn('<polyline', body)
        for name in ('touched', 'seams', 'stages', 'effects', 'study'):
            rows = body[body.index('id="%s"' % name):].split('</table>')[0].count('<tr')
            self.assertGreater(rows, 1, name)
        self.assertRegex(body, r'FIRST_FRAME')
        verdict = body[body.index('id="verdict"'):body.index('id="player"')]
        self.assertRegex(verdict, r'All 79 steps are proved.*The map was used.*First contact.*cloth with octomap: 0\.\d{3} s after')
        self.assertRegex(body, r'id="study_sentence">[^<]*(?:missed or invented|nothing to compare)')
        for name in ('clearance_part', 'scales_part'):
            self.assertNotIn('id="%s"' % name, body, 'what was not asked for takes no place')

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_what_made_it_and_what_touched(self):
        self.report(SCENES / 'felt_and_finger.yaml', 40)
        body, console = self.dom()
        self.assertNotRegex(console, r'CONSOLE.*(?:Error|error)')
        touched = body[body.index('id="touched"'):].split('</table>')[0]
        self.assertRegex(touched, r'<td class="text">finger</td><td>8</td><td>\d</td><td>[\d,]+</td><td>\d\.\d{3}</td>')
        facts = body[body.index('id="facts"'):].split('</table>')[0]
        self.assertRegex(facts, r'analyze_bag \S*scene\.bag --params \S*scene\.yaml --report ')
        self.assertRegex(facts, r'deformable_ccd \d+\.\d+\.\d+, compiled by ')
        self.assertRegex(facts, r'<summary>\S*scene\.yaml</summary><pre>[^<]*minimum_separation_m: 0\.012')
        self.assertRegex(facts, r'\d+ CLEAR, \d+ INTERSECTING, \d+ NOT_CHECKED; frames without an answer: 1')

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_a_run_without_a_map_says_so_on_top(self):
        self.report(SCENES / 'table_edge.yaml', 40, '--without-map')
        body, _ = self.dom()
        verdict = body[body.index('id="verdict"'):body.index('id="player"')]
        self.assertRegex(verdict, r'No map was used.*Nothing was checked against a map: effects/octomap is off\..*Nothing was found to touch')
        self.assertNotIn('id="study"', body, 'what was not asked for takes no place')

    def browser(self):
        """A page of 1280 x 1000 pixels, drawn by software; its console is empty at the end."""
        options = webdriver.ChromeOptions()
        for argument in ('--headless=new', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
                         '--window-size=1280,1000', '--user-data-dir=%s' % (self.own / 'profile')):
            options.add_argument(argument)
        options.set_capability('goog:loggingPrefs', {'browser': 'ALL'})
        driver = webdriver.Chrome(options=options)
        self.addCleanup(driver.quit)
        driver.get(self.page.as_uri())
        return driver

    def player(self):
        page = self.browser()
        if 'without three.js' in page.find_element('id', 'player_note').text:
            self.skipTest('the tools were built without libjs-three')
        return page

    @unittest.skipUnless(webdriver and shutil.which('chromedriver'), 'no chromium-driver or python3-selenium is installed')
    def test_the_player(self):
        data = json.loads((self.folder / 'report.json').read_text())
        page = self.player()

        def text(name):
            return page.find_element('id', name).text

        def seek(seconds):
            page.execute_script("const s = document.getElementById('seek'); s.value = arguments[0];"
                                "s.dispatchEvent(new Event('input'))", seconds)

        # It opens at the first new contact, and fits a narrow window.
        first = min((pair['first'] for pair in data['partners'] if pair['first']), key=lambda one: one['t'])
        self.assertAlmostEqual(page.execute_script('return player.time()'), first['t'], 6)
        page.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {'width': 400, 'height': 900, 'deviceScaleFactor': 1, 'mobile': False})
        page.refresh()
        self.assertLessEqual(page.execute_script('return document.documentElement.scrollWidth'), 400)
        page.execute_cdp_cmd('Emulation.clearDeviceMetricsOverride', {})
        page.refresh()

        # To the step of the first contact: its contacts are those of contacts.csv, and a click says what one is.
        first = data['partners'][0]['first']
        seek(first['t'])
        with open(self.folder / 'contacts.csv', encoding='utf-8') as file:
            rows = [row for row in csv.DictReader(file) if int(row['step']) == first['step']]
        self.assertRegex(text('now'), r'^Step %d, which ended at .*: %d contacts?\b' % (first['step'], len(rows)))
        earliest = min((row for row in rows if row['initial'] == '0'), key=lambda row: float(row['toc_lower']))
        page.execute_script("document.getElementById('view').scrollIntoView({block: 'center'})")
        index, x, y = page.execute_script("""
            const toc = arguments[0], all = player.items();
            const i = all.findIndex(c => c.kind === 'contact' && c.text.includes('between ' + +toc.toPrecision(12) + ' and'));
            return [i, ...(i < 0 ? [0, 0] : player.screenOf(i))]""", float(earliest['toc_lower']))
        self.assertGreaterEqual(index, 0, 'the earliest contact is listed, with its time')
        actions = ActionBuilder(page)
        actions.pointer_action.move_to_location(round(x), round(y)).click()
        actions.perform()
        self.assertRegex(text('picked'), r'^Contact, .*: cloth vert.* \d.*; certain, new\. Time of contact between .* wide\. '
                                         r'Part of patch \d+\.$')
        # The view fits what moves while something touches, its middle in the middle.
        box = page.execute_script("const b = document.getElementById('canvas').getBoundingClientRect(); return [b.left, b.right, b.top, b.bottom]")
        spots = page.execute_script('return player.items().map((_, i) => player.screenOf(i))')
        for low, high, at in ((*box[:2], [x for x, _ in spots]), (*box[2:], [y for _, y in spots])):
            self.assertTrue(low < min(at) and max(at) < high, (low, min(at), max(at), high))
            self.assertLess(abs((min(at) + max(at)) / 2 - (low + high) / 2), (high - low) / 10)
        near = page.execute_script("""return player.items().filter((_, i) => { const [x, y] = player.screenOf(i);
            return Math.hypot(x - arguments[0], y - arguments[1]) < 2; }).map(item => item.text)""", x, y)
        self.assertIn(text('picked'), near, 'what was clicked, or what lies on the same spot')
        self.assertLess(len(near), len(page.execute_script('return player.items()')))
        page.execute_script("player.seek(0)")
        self.assertEqual(text('picked'), 'Click a contact or a patch to see what it is.')

        # What is drawn is the cloth: turning the view changes the picture, and so does another frame.
        def picture():
            return page.execute_async_script("""const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(
                () => done(0)))""") or page.find_element('id', 'canvas').screenshot_as_base64
        at_start = picture()
        seek(first['t'] + 0.3)
        later = picture()
        self.assertNotEqual(at_start, later)
        ActionChains(page).drag_and_drop_by_offset(page.find_element('id', 'canvas'), 150, 20).perform()
        self.assertNotEqual(later, picture())

        # Beside the bodies it has the page's own colour, in either scheme.
        def corner(scheme):
            page.execute_cdp_cmd('Emulation.setEmulatedMedia', {'features': [{'name': 'prefers-color-scheme', 'value': scheme}]})
            return page.execute_async_script("""const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => { player.paint();
                const c = document.getElementById('canvas'), g = c.getContext('webgl2') || c.getContext('webgl'), p = new Uint8Array(4);
                g.readPixels(1, c.height - 2, 1, 1, g.RGBA, g.UNSIGNED_BYTE, p); done([...p]); }))""")[:3]
        self.assertLess(max(corner('dark')), 64)
        self.assertGreater(min(corner('light')), 192)

        # The legend is a list, and no two colour bars are alike.
        legend = [one.text for one in page.find_elements('css selector', 'ul#legend > li')]
        for row, words in zip(legend, ('contact, within its step: early.*late', 'patch, within the run: early.*late', 'grey: expected', 'cloth')):
            self.assertRegex(row, words)
        bars = [one.value_of_css_property('background-image') for one in page.find_elements('css selector', '#legend .scale')]
        self.assertEqual((len(bars), len(set(bars))), (2, 2), bars)

        # Step by step, and playing to a pause.
        before = page.execute_script('return player.time()')
        page.find_element('id', 'on').click()
        self.assertGreater(page.execute_script('return player.time()'), before)
        page.find_element('id', 'back').click()
        self.assertLessEqual(page.execute_script('return player.time()'), before + 0.04)
        page.execute_script('player.seek(0)')
        page.find_element('id', 'play').click()
        # Until it has: a busy machine draws seldom. What never plays runs into Selenium's own limit.
        page.execute_async_script('const done = arguments[0], look = () => player.time() > 0.2 ? done() : setTimeout(look, 20); look()')
        page.find_element('id', 'play').click()
        stopped = page.execute_script('return player.time()')
        self.assertEqual(text('play'), 'Play')
        page.execute_async_script('setTimeout(arguments[0], 300)')
        self.assertEqual(page.execute_script('return player.time()'), stopped)

        # A lane for each two partners, as in report.json; a click on a bar takes the player there.
        bars = page.find_elements('css selector', '#lanes rect.bar')
        self.assertEqual(len(bars), sum(len(pair['bars']) for pair in data['partners']))
        self.assertEqual(len(page.find_elements('css selector', '#lanes line.event')),
                         sum(len(pair['events']) for pair in data['partners']))
        page.execute_script("arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true}))", bars[0])
        self.assertAlmostEqual(page.execute_script('return player.time()'), data['partners'][0]['bars'][0][1], 6)
        self.assertIn(first['text'], text('firsts'))
        self.assertIn(first['stamp'], text('firsts'))
        self.assertEqual(page.execute_script("return performance.getEntriesByType('resource').length"), 0)
        self.assertEqual([line for line in page.get_log('browser') if line['level'] == 'SEVERE'], [])

    @unittest.skipUnless(webdriver and shutil.which('chromedriver'), 'no chromium-driver or python3-selenium is installed')
    def test_a_contact_behind_a_surface_is_drawn_through(self):
        """Seen from above the cloth hides what touches the table, from below the table does."""
        page = self.player()

        def colours():
            """Of each contact that no later one and no ring lies on: its own colour, and that of the picture there."""
            return page.execute_async_script("""const done = arguments[0]; requestAnimationFrame(() => { player.paint();
                const c = document.getElementById('canvas'), g = c.getContext('webgl2') || c.getContext('webgl'), box = c.getBoundingClientRect();
                const all = player.items().map((item, i) => [item, ...player.screenOf(i)]);
                const covers = ([a, u, v], x, y) => { const d = Math.hypot(x - u, y - v); return a.kind === 'contact' ? d < 7 : d > 3 && d < 13; };
                done(all.filter(([a, x, y], i) => a.kind === 'contact' && !all.slice(i + 1).some(b => covers(b, x, y))).map(([a, x, y]) => {
                    const p = new Uint8Array(4);
                    g.readPixels((x - box.left) * c.width / box.width, (box.bottom - y) * c.height / box.height, 1, 1, g.RGBA, g.UNSIGNED_BYTE, p);
                    return [a.rgb.map(v => Math.round(255 * v)), [...p].slice(0, 3)]; })); });""")
        page.execute_script("""player.seek(player.frames.filter(f => f.details).reduce((a, b) => b.details.c.length > a.details.c.length ? b : a).to)""")
        for drag in (0, -150):
            if drag:
                ActionChains(page).drag_and_drop_by_offset(page.find_element('id', 'canvas'), 0, drag).perform()
            found = colours()
            self.assertGreater(len(found), 10, drag)
            self.assertEqual([(drag, own, seen) for own, seen in found if max(abs(a - b) for a, b in zip(own, seen)) > 4], [])

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_one_long_step_does_not_flatten_the_others_and_no_cure_is_cut(self):
        before, data, after = re.split(r'(?<=const R = )(.*?)(?=;\n)', self.page.read_text(), maxsplit=1, flags=re.S)
        run_data = json.loads(data)
        usual = 2 * run_data['total']['p95_ms']
        for step in run_data['steps']:  # of which a busy machine may have made some long
            step['ms'] = min(step['ms'] or 0, run_data['total']['p95_ms'])
        run_data['steps'][30].update(ms=1000 * usual, contacts=100000)
        run_data['proof'].update(unproved='why not, ' * 200 + 'and what to do', proved=0)
        self.page = self.own / 'report.html'
        self.page.write_text(before + json.dumps(run_data).replace('<', '\\u003c') + after)
        body, console = self.dom()
        self.assertNotRegex(console, r'CONSOLE.*(?:Error|error)')
        self.assertIn('and what to do</p>', body[body.index('id="verdict"'):body.index('id="player"')])
        plot = body[body.index('id="latency"'):].split('</svg>')[0]
        self.assertEqual(len(re.findall(r'class="cut"', plot)), 1)
        heights = [float(y) for y in re.findall(r',([\d.]+)', re.search(r'<polyline points="([^"]*)', plot)[1])]
        self.assertEqual(heights.count(min(heights)), 1)
        self.assertGreater(max(heights) - sorted(heights)[1], 20, 'pixels between the others')
        self.assertIn('contacts (logarithmic)', body)

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_how_close(self):
        """A curve a bound of each two partners."""
        self.changed(lambda page: page['monitor'].update(effects={**page['monitor'].get('effects', {}), 'clearance': 'on'}, max_speed_m_s=2,
                                                         speed_scale={'reaction_time_s': .1, 'stopping_time_s': .1}, intent={'horizon_s': 1, 'deviation_m': .01}))
        body, console = self.dom()
        self.assertNotRegex(console, r'CONSOLE.*(?:Error|error)')
        drawn = body[body.index('id="clearance"'):].split('</svg>')[0]
        self.assertRegex(drawn, r'<polyline [^>]*stroke-dasharray="4 3"[^>]*><title>cloth with octomap')
        self.assertRegex(drawn, r'<polyline [^>]*stroke-dasharray="none"[^>]*><title>cloth with octomap')
        self.assertIn('distance [m]', drawn)
        self.assertRegex(body, r'id="clearance_note">[^<]*lower bound.*cloth with octomap')
        self.assertEqual(body[body.index('id="scales"'):].split('</svg>')[0].count('<polyline '), 2, 'with and without ~intended')
        self.assertRegex(body, r'id="promises">safe until: \d+ promises of [\d.]+ s in the middle, \d+ kept, \d+ void, \d+ not looked at')

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_own_voxels(self):
        """Of a camera's map the player's legend names the voxels that are the cloth's own, and those in doubt: the first map has the cloth."""
        camera = {'position_m': [0.9, 0.3, 1.35], 'looks_at_m': [-0.1, 0, 0.85], 'field_of_view_rad': 1.0, 'width': 120, 'height': 90,
                  'rate_hz': 5}
        self.changed(lambda page: page.update(camera=camera, monitor={**page['monitor'], 'own_voxels_m': 'auto'}))
        maps = json.loads(re.search(r'id="player_data">(.*?)</script>', self.page.read_text(), re.S)[1])['maps']
        self.assertTrue(any('own' in m for m in maps) and any('doubted' in m for m in maps))
        body, console = self.dom()
        self.assertNotRegex(console, r'CONSOLE.*(?:Error|error)')
        if 'without three.js' not in body:
            legend = body[body.index('<ul id="legend">'):].split('</ul>')[0]
            self.assertRegex(legend, r'<li>● contact, within its step: early<span.*<li>○ patch, within the run: early<span.*<li>.*cloth</li>')
            self.assertEqual(len(set(re.findall(r'linear-gradient[^;]*;', legend))), 2, 'a bar has one meaning')
            self.assertIn("a body's own voxels", body)
            self.assertIn('voxels in doubt', body)

    @unittest.skipUnless(webdriver and shutil.which('chromedriver'), 'no chromium-driver or python3-selenium is installed')
    def test_without_the_library_the_page_says_so_and_has_the_rest(self):
        page = self.page.read_text()
        self.page = self.own / 'report.html'
        self.page.write_text(re.sub(r'(<script id="three">).*?(</script>)', r'\1\2', page, flags=re.S))
        browser = self.browser()
        self.assertRegex(browser.find_element('id', 'player_note').text, 'has no player: .*three.js')
        self.assertFalse(browser.find_element('id', 'view').is_displayed())
        bars = browser.find_elements('css selector', '#lanes rect.bar')
        self.assertGreater(len(bars), 0)
        browser.execute_script("arguments[0].dispatchEvent(new MouseEvent('click', {bubbles: true}))", bars[0])
        self.assertEqual([line for line in browser.get_log('browser') if line['level'] == 'SEVERE'], [])


if __name__ == '__main__':
    unittest.main()
