"""What is a body's own: of each map the most that the rule of doc/algorithm.md, own voxels, lets a body account for.

It goes from map to map as the rule does, and where it cannot be sure it takes the answer that refutes less: what a body may
have reached it has reached, and what may be in doubt is. What is left is an obstacle in any case.
"""
from dataclasses import replace

import numpy as np

import placed
import touches
from came import NotCovered
from placed import NS, Unknown

MOST_VOXELS = 4000000
NONE, EVER = np.empty(0, np.int64), 1 << 62


def packed(keys):
    keys = np.asarray(keys, np.int64)
    return keys[:, 0] << 32 | keys[:, 1] << 16 | keys[:, 2]


def unpacked(numbers):
    return np.stack([numbers >> 32, numbers >> 16 & 0xffff, numbers & 0xffff], 1)


def voxels(corners, sizes, low, high):
    """The finest voxels of leaves within a box of keys, as numbers."""
    found = [NONE]
    low, high = np.maximum(corners, low), np.minimum(corners + sizes[:, None], high)
    some = (low < high).all(1)
    if (high - low)[some].astype(float).prod(1).sum() > MOST_VOXELS:
        raise NotCovered('more than %d voxels of a map near the bodies' % MOST_VOXELS)
    single = some & (sizes == 1)
    found.append(packed(corners[single]))
    for l, h in zip(low[some & ~single], high[some & ~single]):
        found.append(packed(np.stack(np.meshgrid(*map(np.arange, l, h), indexing='ij'), -1).reshape(-1, 3)))
    return np.concatenate(found)


def shown(corners, sizes, numbers):
    """Which of the voxels lie in one of the leaves."""
    found, keys = np.zeros(len(numbers), bool), unpacked(numbers)
    for size in np.unique(sizes):
        found |= np.isin(packed(keys // size * size), packed(corners[sizes == size]))
    return found


def less(map_, numbers):
    """The map without these voxels."""
    def part(corners, sizes):
        hit = np.zeros(len(sizes), bool)
        for size in np.unique(sizes):
            mine = sizes == size
            hit[mine] = np.isin(packed(corners[mine]), packed(unpacked(numbers) // size * size))
        return ~hit, hit & (sizes == 1)
    return map_.without(part) if len(numbers) else map_


def with_unknown(map_, box):
    """The map, in which each voxel wholly within the box of which it tells nothing is an obstacle."""
    low, high = (np.array(box[i:i + 3]) / map_.resolution + 32768 for i in (0, 3))
    every = voxels(np.zeros((1, 3), int), np.array([65536]), np.ceil(low - 1e-6).astype(int), np.floor(high + 1e-6).astype(int))
    unknown = unpacked(every[~shown(map_.corners, map_.sizes, every) & ~shown(*map_.free, every)])
    return replace(map_, corners=np.concatenate([map_.corners, unknown]), sizes=np.append(map_.sizes, np.ones(len(unknown), int)))


class Owned:
    def __init__(self, world):
        self.world, self.reach = world, world.owners()  # by name, how near a voxel is to be [m]; 'auto' for the edge of one
        self.lag, self.trust = int(world.params.get('own_voxels_lag_s', 0.1) * NS), world.params.get('own_voxels_doubt') == 'trust'
        self.clock = getattr(world.tracks.get(world.clock_body), 'every', [])
        self.of = {}  # by the map's number: what may be own, what may be in doubt
        statics = world.transforms.static.values()
        changes = {s.came for samples in statics for s in samples[1:] if max(s.off(samples[0])) > 1e-6}
        self.moments = [*sorted(came - 1 for came in changes), EVER]  # a static frame has another place at each
        self.every = {name: [list(self.places(name, moment)) for moment in self.moments] for name in self.reach}
        if any(any(some) for some in self.every.values()):
            (self.follow_clouds if world.clouds else self.follow)()

    def know(self, moment):
        """What anybody ever knew, but of static frames what was known then."""
        self.world.transforms.judge(moment, EVER - moment, EVER)

    def back(self, m, stamp):
        """From the fixed frame into the map's, or None."""
        poses = []
        for moment in self.moments:
            self.know(moment)
            poses.append(self.world.transforms.pose(m.frame or self.world.fixed, self.world.fixed, stamp(m)))
        if poses[-1] is not None and any((p != poses[-1]).any() for p in poses):
            raise NotCovered('own voxels of a map whose static frame was sent elsewhere')
        return None if poses[-1] is None else np.linalg.inv(poses[-1])

    def places(self, name, moment):
        """A body at all times at which tf has a place for it: stamp, vertices, surface."""
        self.know(moment)
        track, w = self.world.tracks[name], self.world
        frames = [(f.stamp, f.frame, f.positions, f.surface) for f in track.every]
        if isinstance(track, placed.Rigid):
            # A step takes it where tf has it at the clock's frames, and looks at tf's samples in between.
            stamps = {f.stamp for f in self.clock}
            stamps |= {sample.stamp for samples in w.transforms.samples.values() for sample in samples}
            frames = [(stamp, track.mesh.frame, track.mesh.positions, track.mesh.surface) for stamp in stamps]
        for stamp, frame, points, surface in sorted(frames, key=lambda f: f[0]):
            try:
                yield stamp, placed.carried(w.transforms.pose(frame, w.fixed, stamp), points), surface
            except (Unknown, NotCovered):
                pass  # it has no place there for anybody

    def ways(self, name, begin, end):
        """Straight ways between places: the vertices at both ends, the surface. A static body is where each frame has it at all times."""
        found = []
        for every in self.every[name]:
            times = [stamp for stamp, _, _ in every]
            first, last = np.searchsorted(times, begin, 'right') - 1, np.searchsorted(times, end, 'left') + 1
            moves = self.world.tracks[name].moves
            some = every[max(0, first):last] if moves else every
            found += [(p, q, surface) for (_, p, _), (_, q, surface) in zip(some, some[1:]) if moves and p.shape == q.shape]
            found += [(points, points, surface) for _, points, surface in some]
        return found

    def may_have_a_seam(self, name, begin, end):
        """Was it perhaps not known where it was at some time in between? Then nobody knows of what appears anywhere whether it was there."""
        track, w = self.world.tracks[name], self.world
        clock = {f.stamp for f in self.clock}
        every = [place for place in self.every[name][-1] if not isinstance(track, placed.Rigid) or place[0] in clock]
        first, last = (np.searchsorted([stamp for stamp, _, _ in every], t) for t in (begin, end))
        some, most = every[max(0, first - 1):last + 1], w.params.get('max_vertex_step_m', 0.5) or np.inf
        came = [f.stamp for f in track.every]
        return track.moves and (last == len(every) or len(some) > 1000 or came != sorted(came) or any(
            begin <= stamp <= end for stamp, _, _ in track.refused) or any(
            b - a > NS // 2 or p.shape != q.shape or np.nanmax(touches.length(q - p)) > most for (a, p, _), (b, q, _) in zip(some, some[1:])))

    def reached(self, name, numbers, ways, back, reach, resolution, sure=False):
        """Which voxels come within reach; `sure`: only those that the monitor certainly finds."""
        found = np.zeros(len(numbers), bool)
        middle = (unpacked(numbers) - 32767.5) * resolution
        tolerance = self.world.params.get('rigid_tolerance_m', 1e-3) + 1e-6
        solid = isinstance(self.world.tracks[name], placed.Rigid) and not sure
        for p, q, surface in ways:
            elements = surface.faces if len(surface.faces) else surface.edges[:, [0, 1, 1]]
            p, q = placed.carried(back, p), placed.carried(back, q)
            far = np.fmax.reduce(touches.length(q - p), initial=0)
            many = 0 if far == 0 else 1 if sure else 1 + int(min(64, 4 * far / resolution))
            within = reach - resolution / 2 - tolerance if sure else reach + 0.8661 * resolution + far / max(1, many) + tolerance
            both = np.concatenate([p, q])
            low, high = np.nanmin(both, 0) - within, np.nanmax(both, 0) + within
            left = np.nonzero(~found & ((middle >= low) & (middle <= high)).all(1))[0]
            if not len(left):
                continue
            places = p[elements] + (q - p)[elements] * np.linspace(0, 1, many + 1)[:, None, None, None]
            at = places[np.isfinite(places).all((2, 3))]
            if not len(at):
                continue
            which = touches.overlapping(middle[left] - within, middle[left] + within, at.min(1), at.max(1))
            near = touches.point_to_face(middle[left[which[:, 0]]], at[which[:, 1]]) <= within
            found[left[which[near, 0]]] = True
            if solid and surface.closed:
                low, high = np.nanmin(places, (1, 2)), np.nanmax(places, (1, 2))
                found[left] |= ((middle[left][:, None] >= low) & (middle[left][:, None] <= high)).all(2).any(1)
        return found

    def follow(self):
        w, before, own, doubt, remembered = self.world, None, NONE, NONE, NONE
        ends = np.concatenate([points for some in self.every.values() for places in some for _, points, _ in places])
        box = np.stack(np.meshgrid(*zip(np.nanmin(ends, 0), np.nanmax(ends, 0))), -1).reshape(-1, 3)
        for m in w.maps:
            if m.problem:
                continue
            if before is not None and m.stamp < before.stamp:
                raise NotCovered('maps whose stamps go back, and own voxels')
            if before is not None and (m.frame, m.resolution) != (before.frame, before.resolution):
                before, own, doubt, remembered = None, NONE, NONE, NONE
            back = self.back(m, w.placed_at)
            reach = {name: m.resolution if r == 'auto' else r for name, r in self.reach.items()}
            more, corners = max(reach.values()) + 2 * m.resolution, placed.carried(back, box)
            low, high = (np.floor(x / m.resolution).astype(int) + 32768 for x in (corners.min(0) - more, corners.max(0) + more))
            since = (m if before is None else before).stamp - self.lag
            anywhere = before is not None and any(self.may_have_a_seam(name, since, m.stamp) for name in self.every)
            fresh, gone = voxels(m.corners, m.sizes, *((0, 65536) if anywhere else (low, high))), remembered
            if before is not None:
                vanished = voxels(before.corners, before.sizes, low, high)
                gone = np.concatenate([gone, vanished[~np.isin(vanished, np.concatenate([own, doubt]))]])
                fresh = fresh[~shown(before.corners, before.sizes, fresh)]
            fresh, gone = fresh[~np.isin(fresh, remembered)], gone[~shown(m.corners, m.sizes, gone)]
            lasts = ~shown(*m.free, gone) if len(m.free[1]) else np.zeros(len(gone), bool)
            own, doubt = own[shown(m.corners, m.sizes, own)], doubt[shown(m.corners, m.sizes, doubt)]
            for name in self.every:
                ways = self.ways(name, since, m.stamp)
                near = fresh[self.reached(name, fresh, ways, back, reach[name], m.resolution)]
                first = min((f.stamp for f in w.tracks[name].every or self.clock), default=0)  # from then on its place is known
                is_known = before is not None and (not w.tracks[name].moves or first <= m.stamp)
                if is_known or self.trust:
                    own = np.union1d(own, near)
                else:
                    doubt = np.union1d(doubt, near)
                if len(self.moments) == 1:  # else nobody is certain of where it was
                    lasts |= self.reached(name, gone, ways, back, reach[name], m.resolution, sure=True)
            # What was left, what appeared at a seam, after a gap or from outside of reach: of what may be own all may be in doubt.
            doubt = np.unique(np.concatenate([doubt, own, fresh]))
            self.of[m.number] = own, doubt
            remembered, before = gone[lasts], m

    def follow_clouds(self):
        """What no body ever reached until then is none's own, however often it was seen free before."""
        seen, ever, begin, before, doubt = NONE, np.zeros(0, bool), 0, NONE, NONE
        for m in self.world.maps:
            back, filled = self.back(m, lambda cloud: cloud.stamp), packed(m.corners)
            if begin and any(self.may_have_a_seam(name, begin - self.lag, m.stamp) for name in self.every):
                doubt = np.union1d(doubt, np.setdiff1d(filled, before))
            fresh = np.setdiff1d(filled, seen)
            asked = [(np.concatenate([seen, fresh]), begin - self.lag), (fresh, 0)]
            ever = np.append(ever, np.zeros(len(fresh), bool))
            for numbers, since in asked:
                for name, r in self.reach.items():
                    new = len(ever) - len(numbers) + np.nonzero(~ever[len(ever) - len(numbers):])[0]
                    ways = self.ways(name, since, m.stamp) if len(new) else []
                    ever[new] = self.reached(name, numbers[new - len(ever)], ways, back, m.resolution if r == 'auto' else r, m.resolution)
            seen, begin, before = asked[0][0], m.stamp, filled
            self.of[m.number] = seen[ever], doubt
