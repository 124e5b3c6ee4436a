"""Two pictures of what the monitor says of recordings, and of what no frame shows it."""

SEEN, TOUCHES, NOBODY = '#9aa5b1', '#c62828', '#e8c468'


def pyplot():
    import matplotlib
    matplotlib.use('Agg')
    import matplotlib.pyplot as plt
    return plt


def panel(axis, title, x, y):
    axis.set_title(title, fontsize=10)
    axis.set_xlabel(x)
    axis.set_ylabel(y)
    axis.set_aspect('equal')


def places(array):
    """Where the contacts of a step are: n x 3."""
    import numpy as np
    return np.array([(c.point.x, c.point.y, c.point.z) for c in array.contacts]).reshape(-1, 3)


def draw_said(path, figure_at, answers, rope, leaves):
    """The figure at its step of most contacts, the contacts of each step, and a map from above with where the rope touches it."""
    import numpy as np
    plt = pyplot()
    page, (front, steps, above) = plt.subplots(1, 3, figsize=(12, 4.2), gridspec_kw={'width_ratios': [1, 1.3, 1.7]})
    most = max(answers['samba'].contacts, key=lambda array: len(array.contacts))
    begin = answers['samba'].contacts[0].header.stamp
    at = (most.header.stamp - begin).to_sec()
    p, where = figure_at(at), places(most)
    front.scatter(p[:, 0], p[:, 1], s=0.2, color=SEEN)
    front.scatter(where[:, 0], where[:, 1], s=6, color=TOUCHES)
    panel(front, 'a captured figure, %.2f s: %d contacts' % (at, len(where)), 'x [m]', 'y [m]')
    times = [(array.header.stamp - begin).to_sec() for array in answers['samba'].contacts]
    steps.bar(times, [len(array.contacts) for array in answers['samba'].contacts], width=0.035, color=TOUCHES)
    steps.set_title('its contacts with itself, every step proved', fontsize=10)
    steps.set_xlabel('time [s]')
    steps.set_ylabel('contacts in a step')
    level = np.abs(leaves[:, 2] - np.median(rope[:, :, 2])) < 0.2
    above.scatter(leaves[level, 0], leaves[level, 1], s=0.3, color=SEEN)
    above.plot(rope[:, 0, 0], rope[:, 0, 1], color='#1565c0', linewidth=0.8)
    where = np.concatenate([places(array) for array in answers['maps/fr_079'].contacts])
    above.scatter(where[:, 0], where[:, 1], s=8, color=TOUCHES, zorder=3)
    panel(above, 'a rope through a mapped building: where it touches', 'x [m]', 'y [m]')
    page.tight_layout()
    page.savefig(path, dpi=100)
    plt.close(page)


def draw_blind(path, picture, k, points, poses):
    """A row of the depth picture from above, with what no ray reached; how far captured points may leave the straight way; two poses."""
    import numpy as np
    plt = pyplot()
    page, (above, off, shirt) = plt.subplots(1, 3, figsize=(12, 4.2), gridspec_kw={'width_ratios': [1.2, 1.3, 1]})
    row, far = picture[picture.shape[0] // 2] / 1000.0, 3.5
    slope = (np.arange(len(row)) - k[0, 2]) / k[0, 0]
    for s, next_, z in zip(slope[:-1], slope[1:], row):
        above.fill([s * z, s * far, next_ * far, next_ * z], [z, far, far, z], color=NOBODY, linewidth=0)
    above.plot((slope * row)[row > 0], row[row > 0], '.', color='black', markersize=1)
    panel(above, 'a depth picture from above: yellow is unseen', 'x [m]', 'depth [m]')
    away = np.linalg.norm(points[:-2] - 2 * points[1:-1] + points[2:], axis=2) / 8
    for share, colour in ((100, '#c62828'), (99, '#ef6c00'), (50, SEEN)):
        off.plot(np.arange(1, len(points) - 1) / 25, 1000 * np.percentile(away, share, axis=1), color=colour,
                 label={100: 'the farthest vertex', 99: '99 of 100 are nearer', 50: 'half are'}[share])
    off.set_yscale('log')
    off.set_title('the figure between two frames', fontsize=10)
    off.set_xlabel('time [s]')
    off.set_ylabel('off the straight way, about [mm]')
    off.legend(fontsize=8, loc='center right')
    first, second = poses
    for a, b in zip(first, second):
        shirt.plot([a[0], b[0]], [a[1], b[1]], color=NOBODY, linewidth=0.8)
    shirt.plot(first[:, 0], first[:, 1], '.', color='black', markersize=3)
    shirt.plot(second[:, 0], second[:, 1], '.', color='#1565c0', markersize=3)
    panel(shirt, 'two poses of a T-shirt', 'x', 'y')
    page.tight_layout()
    page.savefig(path, dpi=100)
    plt.close(page)
