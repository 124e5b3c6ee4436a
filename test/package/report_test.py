"""The report's page in a real browser: it draws what it promises, reports no error, and asks for nothing from anywhere."""
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

from checkout import CHECKOUT, TOOLS

BROWSER = next((b for b in ('chromium', 'chromium-browser', 'google-chrome') if shutil.which(b)), None)


class ReportPageTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder, True)
        scene, bag = CHECKOUT / 'config/scenes/table_edge.yaml', self.folder / 'scene.bag'
        for command in ([TOOLS / 'make_scene_bag', scene, bag, '--frames', '80', '--quiet'],
                        [TOOLS / 'analyze_bag', bag, '--report', self.folder, '--accuracy-study', '--quiet']):
            ran = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
            self.assertEqual(ran.returncode, 0, ran.stderr)
        self.page = self.folder / 'report.html'

    def test_loads_nothing(self):
        text = self.page.read_text()
        addresses = set(re.findall(r'https?://[^\s\'"]+', text)) - {'http://www.w3.org/2000/svg'}
        self.assertEqual(addresses, set())
        self.assertNotRegex(text, r'<(?:link|img|iframe)\b|<script[^>]*\bsrc=|@import|\burl\(')

    @unittest.skipUnless(BROWSER, 'no Chromium is installed')
    def test_draws_in_a_browser(self):
        ran = subprocess.run([BROWSER, '--headless', '--no-sandbox', '--disable-gpu', '--enable-logging=stderr', '--v=0',
                              '--user-data-dir=%s' % (self.folder / 'profile'), '--dump-dom', self.page.as_uri()],
                             capture_output=True, text=True, timeout=120, check=False)
        self.assertNotRegex(ran.stderr, r'CONSOLE.*(?:Error|error)')
        dom = ran.stdout
        body = dom[:dom.index('<script>')]
        for name, least in (('contacts', 10), ('toc', 10), ('rungs_plot', 2), ('study_plot', 15)):
            drawn = body[body.index('id="%s"' % name):].split('</svg>')[0]
            self.assertGreater(len(re.findall(r'<(?:rect|circle)\b', drawn)), least, name)
        self.assertIn('<polyline', body)
        self.assertGreaterEqual(body.count('<canvas'), 2, 'how often, and when first')
        for name in ('seams', 'stages', 'effects', 'rungs', 'study', 'tiers'):
            rows = body[body.index('id="%s"' % name):].split('</table>')[0].count('<tr')
            self.assertGreater(rows, 1, name)
        self.assertRegex(body, r'FIRST_FRAME')
        self.assertRegex(body, r'id="study_sentence">[^<]*(?:missed or invented|nothing to compare)')


if __name__ == '__main__':
    unittest.main()
