// What a step takes from the memory of pairs, and leaves in it.
#include <algorithm>

#include "dccd/accuracy.h"
#include "dccd/tolerances.h"
#include "step/history.h"

namespace dccd {

using Clock = Deadline::Clock;

namespace {

constexpr std::size_t GROUPS = 64;  // in a unit of work
// Pairs of them that are worth a memory: of fewer, to turn it on takes as long as a dozen steps save.
constexpr std::size_t FEWEST_GROUPS = 100;

}  // namespace

/// A rung that proves nothing may call apart what meets, and meeting what is apart: it has to see what it would see
/// otherwise. So has who watches a pair. A step aside is alone, and uncertain vertices have other radii in each step.
bool History::Impl::mayRemember(const Part& part) {
  const bool wanted = options->keep_bounds && !stopsAtFirst() && provesAnswers(options->accuracy.rung) && !observer &&
                      !aside && options->broad_phase == BroadPhase::CLUSTERED && !scene.uncertain() &&
                      scene.size() > tolerance::REMEMBERED_SMALLEST_M && scene.size() < tolerance::REMEMBERED_LARGEST_M;
  if (!wanted) return false;
  if (carried.memory.state() == PairMemory::State::OFF) return true;
  return part.continues && std::none_of(scene.bodies().begin(), scene.bodies().end(),
                                        [](const SceneBody& body) { return body.mask_changed; });
}

/// Asks for each group what of it is to be tested, and makes the bounds that this needs. Where there is more than may
/// be kept, the step goes on without.
void History::Impl::useMemory(StepContext& context) {
  const Clock::time_point start = Clock::now();
  PairMemory& memory = carried.memory;
  memory.beginGroups(scene);
  for (const PairTask& task : tasks) {
    for (std::uint32_t p = task.first; p < task.last; ++p) {
      memory.addGroup({task.kind, task.body_a, task.body_b}, group_pairs[2 * p], group_pairs[2 * p + 1]);
    }
  }
  std::atomic<bool> whole{true};
  parallel(memory.groupCount(), GROUPS, [&](std::size_t first, std::size_t last) {
    for (std::size_t g = first; g < last && whole; ++g) {
      if (g % GROUPS == 0 && context.timeIsUp()) whole = false;
      const MemoryTrees& trees = memory.group(g).trees;
      if (whole && !memory.consult(scene, g, context.contactDistance(trees.body_a, trees.body_b))) whole = false;
    }
  });
  if (whole) context.memory = &memory;
  for (std::size_t b = 0; b < scene.bodies().size(); ++b) {
    if (scene.bodies()[b].whole || context.expired) continue;
    for (const FeatureKind kind : {FeatureKind::VERTEX, FeatureKind::EDGE, FeatureKind::FACE}) {
      parallel(scene.bodies()[b].tree(kind).level(0).groups, GROUPS, [&](std::size_t first, std::size_t last) {
        for (std::size_t g = first; g < last; ++g) {
          if (!whole || memory.isMarked(b, kind, g)) scene.refitMembers(b, kind, g);
        }
      });
    }
  }
  if (!whole) memory.giveUp();
  result.stats[Stage::BROAD_PHASE].ms += msSince(start);
}

/// A trial costs some hundredths of a step: where no step continues the one before there is none.
void History::Impl::rememberPairs(const StepContext& context, const Part& part) {
  PairMemory& memory = carried.memory;
  if (!result.complete || context.expired) return memory.clear();
  if (context.memory) return memory.endStep();
  if (!part.continues || group_pairs.size() / 2 < FEWEST_GROUPS || !memory.wantsTrial()) return;
  const Clock::time_point start = Clock::now();
  memory.beginGroups(scene);
  std::size_t i = 0;
  for (const PairTask& task : tasks) {
    for (std::uint32_t p = task.first; p < task.last; ++p) {
      if (i++ % PairMemory::TRIAL_SHARE != 0) continue;
      memory.addGroup({task.kind, task.body_a, task.body_b}, group_pairs[2 * p], group_pairs[2 * p + 1]);
    }
  }
  memory.beginTrial(scene);
  result.stats[Stage::BROAD_PHASE].ms += msSince(start);
}

}  // namespace dccd
