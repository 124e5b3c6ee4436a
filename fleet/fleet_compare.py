"""What changed between the results of two versions or sets of parameters."""
import html
import itertools
import pathlib

import fleet_database
import fleet_tables

CONTACT = ('kind', 'body_0', 'body_1', 'v0', 'v1', 'v2', 'v3', 'voxel_x', 'voxel_y', 'voxel_z', 'voxel_size')


def patches_of(database, name):
    rows = database.execute('SELECT * FROM patches WHERE recording = ? ORDER BY first_s, patch', (name,)).fetchall()
    by_pair = {}
    for row in rows:
        by_pair.setdefault((row['body_0'], row['body_1']), []).append(row)
    return by_pair


def compare_patches(before, after):
    """Of a pair of bodies a patch is the same one where the times overlap the longest; moved: it begins or ends at another time."""
    new, gone, moved = [], [], []
    for pair in sorted(set(before) | set(after)):
        old, left = list(before.get(pair, [])), list(after.get(pair, []))
        for patch in old:
            def overlap(other):
                return min(patch['last_s'], other['last_s']) - max(patch['first_s'], other['first_s'])
            same = max(left, key=overlap, default=None)
            if same is None or overlap(same) < 0:
                gone.append(patch)
                continue
            left.remove(same)
            if (same['first_s'], same['last_s']) != (patch['first_s'], patch['last_s']):
                moved.append((patch, same))
        new += left
    return new, gone, moved


def steps_of(path):
    """Per stamp: the contacts by features, with their times."""
    for stamp, rows in itertools.groupby(fleet_tables.rows(path), key=lambda row: int(row['stamp_ns'])):
        yield stamp, {tuple(row[c] for c in CONTACT): (row['toc_lower'], row['toc_upper'], row['certainty']) for row in rows}


def compare_contacts(before, after):
    """How many contacts are new, gone, and at another time."""
    new = gone = moved = 0
    olds, nows = steps_of(before), steps_of(after)
    old, now = next(olds, None), next(nows, None)
    while old or now:
        if old and (not now or old[0] < now[0]):
            gone += len(old[1])
            old = next(olds, None)
        elif now and (not old or now[0] < old[0]):
            new += len(now[1])
            now = next(nows, None)
        else:
            new += len(now[1].keys() - old[1].keys())
            gone += len(old[1].keys() - now[1].keys())
            moved += sum(old[1][key] != now[1][key] for key in old[1].keys() & now[1].keys())
            old, now = next(olds, None), next(nows, None)
    return new, gone, moved


def total_ms(database, name):
    row = database.execute("SELECT median_ms FROM timings WHERE recording = ? AND stage = 'total'", (name,)).fetchone()
    return row['median_ms'] if row else None


def compare_recording(name, before, after, folders):
    """Lines of what changed, and both medians."""
    a, b = (database.execute('SELECT * FROM recordings WHERE name = ?', (name,)).fetchone() for database in (before, after))
    if a is None or b is None:
        return ['is new' if a is None else 'is gone'], None, None
    lines = []
    if a['state'] != b['state']:
        lines.append('%s, was %s' % (b['state'], a['state']))
    if a['first_new_contact_s'] != b['first_new_contact_s']:
        def said(x):
            return 'none' if x is None else '%.6f s' % x
        lines.append('first new contact %s, was %s' % (said(b['first_new_contact_s']), said(a['first_new_contact_s'])))
    new, gone, moved = compare_patches(patches_of(before, name), patches_of(after, name))

    def patch(p):
        return '%s – %s from %.4f s to %.4f s' % (p['body_0'], p['body_1'], p['first_s'], p['last_s'])
    lines += ['new patch %s' % patch(p) for p in new] + ['gone patch %s' % patch(p) for p in gone]
    lines += ['moved patch %s, was %s' % (patch(p), patch(was)) for was, p in moved]
    if a['contacts_sha256'] != b['contacts_sha256'] and a['contacts_sha256'] and b['contacts_sha256']:
        counts = compare_contacts(*(folder / 'recordings' / name / 'report' / 'contacts.csv' for folder in folders))
        if any(counts):
            lines.append('contacts: %d new, %d gone, %d moved' % counts)
    return lines, total_ms(before, name), total_ms(after, name)


def compare(before_folder, after_folder):
    """The text, and whether anything changed; the page goes into the second folder. Timings alone are no change."""
    folders = [pathlib.Path(before_folder), pathlib.Path(after_folder)]
    before, after = (fleet_database.open_database(folder / 'fleet.sqlite') for folder in folders)
    names = sorted({row['name'] for database in (before, after) for row in database.execute('SELECT name FROM recordings')})
    text, page_rows, medians, changed = [], [], [], 0
    for name in names:
        lines, was_ms, now_ms = compare_recording(name, before, after, folders)
        changed += bool(lines)
        text += ['%s: %s' % (name, line) for line in lines]
        timing = ''
        if was_ms and now_ms:
            medians.append((was_ms, now_ms))
            timing = '%.3f → %.3f' % (was_ms, now_ms)
        page_rows.append('<tr class="%s"><td>%s</td><td>%s</td><td data-key="%s">%s</td></tr>' % (
            'changed' if lines else 'same', html.escape(name), '<br>'.join(map(html.escape, lines)) or 'the same',
            (now_ms or 0) / was_ms if was_ms else 0, timing))
    if medians:
        text.append('median milliseconds a step: %.3f, was %.3f' % (sum(m[1] for m in medians) / len(medians),
                                                                  sum(m[0] for m in medians) / len(medians)))
    text.append('%d of %d recordings changed' % (changed, len(names)))
    head = '<th>recording</th><th>what changed</th><th>median step [ms]</th>'
    (folders[1] / 'compare.html').write_text(
        fleet_database.page('What changed', html.escape('%s, held against %s: %s.' % (folders[1], folders[0], text[-1])), head,
                            '\n'.join(page_rows)))
    return text, changed > 0
