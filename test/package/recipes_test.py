"""doc/development.md, "How to add": a toy of a kind, added in the files that the page names and no others, is built and seen."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

from checkout import CHECKOUT, TOOLS, tracked_files

TOY_RUNG = '''#include "dccd/elementary.h"

namespace dccd {
namespace {

class ToyRung : public Rung {
 public:
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters&) const override {
    for (std::size_t i = 0; i < batch.count; ++i) results[i] = ElementaryResult();
  }
};

}  // namespace

std::unique_ptr<Rung> makeToyRung(const AccuracyOptions&) { return std::make_unique<ToyRung>(); }

}  // namespace dccd
'''
# File -> (text there, text that takes its place); None: the file is new.
RUNG = {
    'include/dccd/elementary.h': ('EXACT = 3 }', 'EXACT = 3, TOY }'),
    'src/elementary/toy.cpp': (None, TOY_RUNG),
    'src/elementary/elementary.cpp': [
        ('\nnamespace {\n', '\nstd::unique_ptr<Rung> makeToyRung(const AccuracyOptions& options);\n\nnamespace {\n'),
        ('{"exact", makeExactRung, false},\n', '{"exact", makeExactRung, false},\n    {"toy", makeToyRung, false},\n')],
}
EFFECT = {
    'include/dccd/outcome.h': ('ROW(CLEARANCE, clearance)\n', 'ROW(CLEARANCE, clearance) \\\n  ROW(TOY, toy)\n'),
    'src/step/effect_plan.cpp': [
        ('/// By Effect:', 'Finding toy(const EffectScene& scene) {\n'
                          '  return scene.bodies.size() > 1 ? wanted("toys like company") : notWanted("a toy is alone");\n}\n\n'
                          '/// By Effect:'),
        (' clearance,\n};', ' clearance, toy,\n};')],
    'src/step/detect.cpp': ('  outcome.stats.total_ms = ',
                            '  if (options.toy) outcome.stats[Effect::TOY].in = step.bodies.size();\n  outcome.stats.total_ms = '),
    'include/dccd/detect.h': ('  bool patches = false;', '  bool toy = true;\n  bool patches = false;'),
    'src/step/option_rows.h': [('expected, patches, clearance, excluded]', 'expected, toy, patches, clearance, excluded]'),
                               ('recorded(patches)', 'recorded(toy), recorded(patches)')],
    'msg/StepStats.msg': ('StageStats[19] stages', 'StageStats[20] stages'),
}
USER = r'''
#include <dccd/accuracy.h>
#include <dccd/detect.h>
#include <dccd/effect_plan.h>

#include <cstdio>

using namespace dccd;

int main() {
  Step step;
  step.bodies.resize(2);
  for (std::size_t b = 0; b < 2; ++b) {
    const double z = static_cast<double>(b);
    Body& body = step.bodies[b];
    body.name = std::to_string(b);
    body.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
    body.t0 = share(Positions{{0, 0, 0.5 - z}, {1, 0, 0.5 - z}, {0, 1, 0.5 - z}});
    body.t1 = share(Positions{{0, 0, z - 0.5}, {1, 0, z - 0.4}, {0, 1, z - 0.6}});
  }
  Options options;
  options.accuracy.rung = accuracyFromString("toy");
  History history;
  const Outcome outcome = detect(step, options, history);
  Step back = step;  // begins where the first one ended
  for (std::size_t b = 0; b < 2; ++b) std::swap(back.bodies[b].t0, back.bodies[b].t1);
  History fresh;
  const Outcome second = detect(back, options, history), alone = detect(back, options, fresh);
  options.toy = false;
  const Outcome without = detect(step, options, history);
  EffectScene scene;
  scene.bodies = step.bodies;
  const EffectPlan plan(scene, {});
  std::printf("%s %zu undecided %d %s, %d of them, %d when it is off; back %zu, alone %zu\n", toString(allRungs().back()), outcome.counts.undecided,
              plan.running(Effect::TOY), plan.lines()[static_cast<std::size_t>(Effect::TOY)].c_str(),
              static_cast<int>(outcome.stats[Effect::TOY].in), static_cast<int>(without.stats[Effect::TOY].in),
              second.counts.undecided, alone.counts.undecided);
}
'''


def recipe(kind):
    """The files that the page's paragraph names, and the folders for new ones."""
    page = (CHECKOUT / 'doc/development.md').read_text()
    text = page[page.index('**%s.**' % kind):]
    text = text[:text.index('\n\n')]
    return set(re.findall(r'`((?:include|src|msg)/[\w./]+)`', text))


def edited(edits):
    """The files' texts with the edits, by name."""
    texts = {}
    for name, changes in edits.items():
        for before, after in changes if isinstance(changes, list) else [changes]:
            text = '' if before is None else texts.get(name) or (CHECKOUT / name).read_text()
            assert before is None or before in text, '%s has no %r' % (name, before)
            texts[name] = text.replace(before, after, 1) if before else after
    return texts


class RecipesTest(unittest.TestCase):
    def test_as_few_files_as_promised_and_the_page_names_them(self):
        for kind, edits, most in (('a rung', RUNG, 3), ('an effect', EFFECT, 6)):
            new = {name for name, changes in edits.items() if changes[0] is None}
            named = recipe(kind)
            self.assertLessEqual(set(edits) - new, named, kind)
            self.assertLessEqual({str(pathlib.Path(name).parent) + '/' for name in new}, named, kind)
            self.assertLessEqual(len(edits), most)
            self.assertEqual(set(edited(edits)), set(edits))

    @unittest.skipUnless(os.environ.get('DEFORMABLE_CCD_LONG'), 'builds the core anew: --long')
    def test_toys_are_built_and_seen(self):
        with tempfile.TemporaryDirectory() as folder:
            tree = pathlib.Path(folder, 'tree')
            for path in tracked_files():
                to = tree / path.relative_to(CHECKOUT)
                to.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, to)
            for name, text in {**edited(RUNG), **edited(EFFECT)}.items():
                (tree / name).write_text(text)
            (tree / 'user.cpp').write_text(USER)
            build = tree / 'build'
            for command in (['cmake', '-S', str(tree), '-B', str(build), '-DDEFORMABLE_CCD_CORE_ONLY=ON', '-DDEFORMABLE_CCD_TESTS=OFF'],
                            ['cmake', '--build', str(build), '--target', 'deformable_ccd', '-j2'],
                            ['g++', '-std=c++17', '-I' + str(tree / 'include'), '-isystem', '/usr/include/eigen3', 'user.cpp',
                             '-L' + str(build), '-ldeformable_ccd', '-Wl,--disable-new-dtags,-rpath,' + str(build), '-o', 'user']):
                ran = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
                self.assertEqual(ran.returncode, 0, ran.stdout[-3000:] + ran.stderr[-3000:])
            # The tree's own library, whatever LD_LIBRARY_PATH says: an old-style rpath comes before it.
            ran = subprocess.run([str(tree / 'user')], capture_output=True, text=True, check=False)
            self.assertEqual(ran.returncode, 0, ran.stderr)
            said = ran.stdout
            self.assertRegex(said, r'^toy [1-9]\d* undecided 1 toy: on, toys like company, 2 of them, 0 when it is off; back ([1-9]\d*), alone \1$')
            self.publish_toy(tree)

    def publish_toy(self, tree):
        """The message with a row more is generated, and what fills it compiles: it demands a row of each effect."""
        headers = TOOLS.parents[1] / 'include'
        generator = shutil.which('gen_cpp.py') or '/usr/lib/gencpp/gen_cpp.py'
        if not (headers / 'deformable_ccd/StepStats.h').is_file() or not os.path.isfile(generator):
            self.skipTest('the toy was built and seen; no messages are generated here, so that its row was not')
        for command in ([sys.executable, generator, 'msg/StepStats.msg', '-p', 'deformable_ccd', '-o', 'made/deformable_ccd',
                         '-I', 'deformable_ccd:msg', '-I', 'std_msgs:/usr/share/std_msgs/msg', '-e', '/usr/share/gencpp'],
                        ['g++', '-std=c++17', '-fsyntax-only', '-Imade', '-Iinclude', '-Isrc', '-I' + str(headers),
                         '-isystem', '/usr/include/eigen3', 'src/output/output_messages.cpp']):
            ran = subprocess.run(command, cwd=tree, capture_output=True, text=True, check=False)
            self.assertEqual(ran.returncode, 0, ran.stdout[-3000:] + ran.stderr[-3000:])
        self.assertRegex((tree / 'made/deformable_ccd/StepStats.h').read_text(), r'boost::array<.*StageStats.*, 20>')


if __name__ == '__main__':
    unittest.main()
