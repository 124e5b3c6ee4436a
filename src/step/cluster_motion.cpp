#include "step/cluster_motion.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace dccd {

void ClusterMotion::clear() {
  bodies_.clear();
  bodies_.shrink_to_fit();
}

std::size_t ClusterMotion::bytes() const {
  std::size_t bytes = 0;
  for (const BodyMotion& body : bodies_) {
    bytes += body.blocks.capacity() * sizeof(Block);
    for (int k = 0; k < 3; ++k) {
      bytes += body.clusters[k].capacity() * sizeof(Cluster) + body.links[k].capacity() * sizeof(std::uint32_t);
    }
  }
  return bytes;
}

void ClusterMotion::setBodies(const SceneArrays& scene) {
  bodies_ = std::vector<BodyMotion>(scene.bodies().size());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pieces;  // of a cluster, and how many of its corners are there
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const SceneBody& body = scene.bodies()[b];
    BodyMotion& motion = bodies_[b];
    motion.blocks.resize((body.usedCount() + BLOCK - 1) / BLOCK);
    for (int kind = 0; kind < 3; ++kind) {
      const ClusterTree& tree = body.trees[kind];
      if (tree.featureCount() == 0) continue;
      motion.clusters[kind].resize(tree.level(0).groups + 1);  // the last one ends the links of the one before
      for (std::size_t g = 0; g < tree.level(0).groups; ++g) {
        pieces.clear();
        const std::size_t end = std::min((g + 1) * simd::GROUP, tree.featureCount()) * tree.arity();
        for (std::size_t i = g * simd::GROUP * tree.arity(); i < end; ++i) {
          const auto piece = static_cast<std::uint32_t>((tree.feature(0)[i] - body.internal_begin) / PIECE);
          // A handful of them, most of them the one before.
          auto at = std::find_if(pieces.rbegin(), pieces.rend(), [&](const auto& p) { return p.first == piece; });
          if (at == pieces.rend()) {
            pieces.push_back({piece, 1});
          } else {
            ++at->second;
          }
        }
        std::sort(pieces.begin(), pieces.end());
        Cluster& cluster = motion.clusters[kind][g];
        std::size_t most = 0;
        for (std::size_t i = 0, j = 0; i < pieces.size(); i = j) {
          const std::size_t block = pieces[i].first / (BLOCK / PIECE);
          std::size_t vertices = 0;
          for (j = i; j < pieces.size() && pieces[j].first / (BLOCK / PIECE) == block; ++j)
            vertices += pieces[j].second;
          if (vertices > most) {
            most = vertices;
            cluster.block = static_cast<std::uint32_t>(block);
          }
        }
        for (const auto& piece : pieces) motion.links[kind].push_back(piece.first);
        motion.clusters[kind][g + 1].first_link = static_cast<std::uint32_t>(motion.links[kind].size());
      }
      motion.links[kind].shrink_to_fit();
    }
  }
}

bool ClusterMotion::isStill(const SceneArrays& scene, std::size_t b) {
  const SceneBody& body = scene.bodies()[b];
  return std::all_of(
      scene.vertices() + body.internal_begin, scene.vertices() + body.internal_begin + body.usedCount(),
      [](const VertexMotion& v) { return v.t0[0] == v.t1[0] && v.t0[1] == v.t1[1] && v.t0[2] == v.t1[2]; });
}

/// Whatever the rotation is, the residuals are measured with it; a poor one only makes them larger. The best one, by
/// Cayley's form: x1 = Q x0 with the axis and tan(angle / 2) in w says x1 - x0 = w x (x1 + x0), linear in w.
void ClusterMotion::Block::fit(const VertexMotion* v, std::size_t n) {
  double sum_from[3] = {0, 0, 0}, sum_to[3] = {0, 0, 0};
  for (std::size_t i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) {
      sum_from[c] += v[i].t0[c];
      sum_to[c] += v[i].t1[c];
    }
  }
  for (int c = 0; c < 3; ++c) {
    from[c] = sum_from[c] / static_cast<double>(n);
    to[c] = sum_to[c] / static_cast<double>(n);
  }
  double xx = 0, yy = 0, zz = 0, xy = 0, xz = 0, yz = 0, right[3] = {0, 0, 0};
  for (std::size_t i = 0; i < n; ++i) {
    double sum[3], difference[3];
    for (int c = 0; c < 3; ++c) {
      const double x0 = v[i].t0[c] - from[c], x1 = v[i].t1[c] - to[c];
      sum[c] = x1 + x0;
      difference[c] = x1 - x0;
    }
    xx += sum[0] * sum[0];
    yy += sum[1] * sum[1];
    zz += sum[2] * sum[2];
    xy += sum[0] * sum[1];
    xz += sum[0] * sum[2];
    yz += sum[1] * sum[2];
    right[0] += sum[1] * difference[2] - sum[2] * difference[1];
    right[1] += sum[2] * difference[0] - sum[0] * difference[2];
    right[2] += sum[0] * difference[1] - sum[1] * difference[0];
  }
  // (|s|^2 I - s s') w = s x d, summed up; by the adjugate. A little is added where all points lie on a line.
  const double little = tolerance::ROTATION_FIT * (xx + yy + zz);
  const double a = yy + zz + little, d = xx + zz + little, f = xx + yy + little;
  const double p = d * f - yz * yz, q = yz * xz + xy * f, r = xy * yz + d * xz;
  const double determinant = a * p - xy * q - xz * r;
  double w[3] = {0, 0, 0};
  if (determinant > 0) {
    w[0] = (p * right[0] + q * right[1] + r * right[2]) / determinant;
    w[1] = (q * right[0] + (a * f - xz * xz) * right[1] + (a * yz + xy * xz) * right[2]) / determinant;
    w[2] = (r * right[0] + (a * yz + xy * xz) * right[1] + (a * d - xy * xy) * right[2]) / determinant;
  }
  const double square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], scale = 2 / (1 + square);
  half_cosine = 1 / std::sqrt(1 + square);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) rotation[3 * i + j] = scale * (w[i] * w[j] - (i == j ? square : 0)) + (i == j);
  }
  rotation[1] -= scale * w[2];
  rotation[2] += scale * w[1];
  rotation[3] += scale * w[2];
  rotation[5] -= scale * w[0];
  rotation[6] -= scale * w[1];
  rotation[7] += scale * w[0];
}

void ClusterMotion::Block::measure(const VertexMotion* v, std::size_t n) {
  for (std::size_t piece = 0; piece * PIECE < n; ++piece) {
    double most = 0;
    bool finite = true;
    for (std::size_t i = piece * PIECE; i < std::min(n, (piece + 1) * PIECE); ++i) {
      double at[3], squared = 0;
      move(v[i].t0, at);
      for (int c = 0; c < 3; ++c) squared += (at[c] - v[i].t1[c]) * (at[c] - v[i].t1[c]);
      finite = finite && squared < std::numeric_limits<double>::infinity();
      most = std::max(most, squared);
    }
    residual[piece] = finite ? std::sqrt(most) * (1 + tolerance::LENGTH) : std::numeric_limits<double>::infinity();
  }
}

void ClusterMotion::fitBlocks(const SceneArrays& scene, std::size_t b, std::size_t first, std::size_t last) {
  const SceneBody& body = scene.bodies()[b];
  for (std::size_t k = first; k < last; ++k) {
    Block& block = bodies_[b].blocks[k];
    const VertexMotion* v = scene.vertices() + body.internal_begin + k * BLOCK;
    const std::size_t n = std::min(BLOCK, body.usedCount() - k * BLOCK);
    block.fit(v, n);
    block.measure(v, n);
  }
}

void ClusterMotion::boundClusters(const SceneArrays& scene, std::size_t b, int kind, std::size_t first,
                                  std::size_t last) {
  BodyMotion& motion = bodies_[b];
  const ClusterTree& tree = scene.bodies()[b].trees[kind];
  last = std::min(last, tree.level(0).groups);
  for (std::size_t g = first; g < last; ++g) {
    Cluster& cluster = motion.clusters[kind][g];
    scene.ballAtStart(tree.level(0).aos.data() + g * simd::AOS_SIZE, cluster.centre, cluster.radius);
    const Block& home = motion.blocks[cluster.block];
    double residual = 0, missed = 0;
    std::uint32_t before = cluster.block;
    for (std::uint32_t l = cluster.first_link; l < motion.clusters[kind][g + 1].first_link; ++l) {
      const std::uint32_t piece = motion.links[kind][l], block = static_cast<std::uint32_t>(piece / (BLOCK / PIECE));
      if (block != before) missed = block == cluster.block ? 0 : home.misses(motion.blocks[block], cluster);
      before = block;
      const double here = motion.blocks[block].residual[piece % (BLOCK / PIECE)] + missed;
      if (!(here <= residual) && residual == residual) residual = here;  // one that is no number stays
    }
    cluster.residual = residual;
  }
}

}  // namespace dccd
