"""The database and the page of a fleet, made anew from the recordings' results."""
import html
import json
import pathlib
import sqlite3

SCHEMA = '''
CREATE TABLE recordings (
  name TEXT PRIMARY KEY,
  bag TEXT, bag_bytes INTEGER,  -- of several pieces a path a line
  state TEXT,                   -- proved, not proved, failed (it cannot be answered), missing
  headline TEXT, said TEXT,     -- the report's first sentence; what analyze_bag said of what is not proved, or failed
  frames INTEGER, answered INTEGER, unanswered_share REAL,
  duration_s REAL, first_new_contact_s REAL,
  compute_s REAL, max_memory_kb INTEGER,
  contacts_sha256 TEXT);
CREATE TABLE partners (recording TEXT, body_0 TEXT, body_1 TEXT, first_s REAL, in_contact_s REAL, contacts INTEGER,
  patches INTEGER);
CREATE TABLE patches (recording TEXT, patch INTEGER, body_0 TEXT, body_1 TEXT, beginning TEXT, first_s REAL, last_s REAL,
  steps INTEGER, contacts INTEGER, largest_m2 REAL, expected INTEGER);
CREATE TABLE events (recording TEXT, step INTEGER, event TEXT, patch INTEGER, others TEXT, body_0 TEXT, body_1 TEXT,
  expected INTEGER, earliest_s REAL, latest_s REAL);
CREATE TABLE statuses (recording TEXT, status TEXT, frames INTEGER);
CREATE TABLE timings (recording TEXT, stage TEXT, median_ms REAL, p95_ms REAL);
CREATE TABLE slowest (recording TEXT, step INTEGER, time_s REAL, ms REAL);
CREATE TABLE parameters (name TEXT, value TEXT);
CREATE TABLE versions (component TEXT, version TEXT);
'''
STATES = {0: 'proved', 3: 'not proved', 1: 'failed'}


def results_of(fleet, folder):
    """Of every recording; None: there is none."""
    for recording in fleet['recordings']:
        path = folder / 'recordings' / recording['name'] / 'result.json'
        yield recording, json.loads(path.read_text()) if path.exists() else None


def insert(database, table, recording, row_list):
    for row in row_list:
        row = {'recording': recording, **row}
        database.execute('INSERT INTO %s (%s) VALUES (%s)' % (table, ', '.join(row), ', '.join('?' * len(row))),
                         tuple(row.values()))


def fill(database, fleet, folder, snakemake_version):
    database.executescript(SCHEMA)
    for recording, result in results_of(fleet, folder):
        name, bags = recording['name'], '\n'.join(recording['bags'])
        if not result:
            database.execute('INSERT INTO recordings (name, bag, state) VALUES (?, ?, ?)', (name, bags, 'missing'))
            continue
        tables = result.get('tables', {})
        database.execute(
            'INSERT INTO recordings VALUES (%s)' % ', '.join('?' * 14),
            (name, bags, result['bag_bytes'], STATES[result['exit']], result['headline'], result['said'],
             tables.get('frames'), tables.get('answered'), tables.get('unanswered_share'), tables.get('duration_s'),
             tables.get('first_new_contact_s'), result['seconds'], result['max_memory_kb'],
             tables.get('contacts_sha256')))
        for table in ('partners', 'patches', 'events', 'timings', 'slowest'):
            columns = {column[1] for column in database.execute('PRAGMA table_info(%s)' % table)}
            insert(database, table, name, [{k: v for k, v in row.items() if k in columns} for row in tables.get(table, [])])
        insert(database, 'statuses', name, [{'status': s, 'frames': n} for s, n in tables.get('statuses', {}).items()])
    database.executemany('INSERT INTO parameters VALUES (?, ?)',
                         [('params', fleet['params'] or ''), ('text', fleet['params_text']), ('options', ' '.join(fleet['options']))])
    database.executemany('INSERT INTO versions VALUES (?, ?)', [('deformable_ccd', fleet['version']),
                                                                ('snakemake', snakemake_version)])


PAGE = pathlib.Path(__file__).resolve().parent / 'page.html'
COLUMNS = (('recording', ''), ('state', ''), ('first new contact', 's'), ('in contact, by pair', 's'), ('unanswered', '%'),
           ('slowest step', 'ms'), ('duration', 's'), ('computed in', 's'), ('said', ''))


def cell(text, key=None):
    return '<td%s>%s</td>' % ('' if key is None else ' data-key="%s"' % key, text)


def page_row(database, one):
    name = one['name']
    link = 'recordings/%s/report/report.html' % name
    text = html.escape(name)
    if one['answered'] is not None:
        text = '<a href="%s">%s</a>' % (html.escape(link, quote=True), text)
    pairs = database.execute('SELECT * FROM partners WHERE recording = ? ORDER BY in_contact_s DESC', (name,)).fetchall()
    slow = database.execute('SELECT * FROM slowest WHERE recording = ? ORDER BY ms DESC', (name,)).fetchone()

    def value(x, form):
        return cell('–', 'inf') if x is None else cell(form % x, repr(x))
    return '<tr class="%s">%s</tr>' % (one['state'].replace(' ', '-'), ''.join([
        cell(text, html.escape(name, quote=True)), cell(one['state']), value(one['first_new_contact_s'], '%.4f'),
        cell('<br>'.join('%s – %s: %.3f' % (html.escape(p['body_0']), html.escape(p['body_1']), p['in_contact_s']) for p in pairs),
             sum(p['in_contact_s'] for p in pairs)),
        value(None if one['unanswered_share'] is None else 100 * one['unanswered_share'], '%.2f'),
        cell('–', 0) if slow is None else cell('%.2f at %.3f s' % (slow['ms'], slow['time_s']), slow['ms']),
        value(one['duration_s'], '%.1f'), value(one['compute_s'], '%.1f'),
        cell('<br>'.join(map(html.escape, (one['said'] or '').split('\n'))))]))


def fleet_page(database):
    recordings = database.execute('SELECT * FROM recordings ORDER BY name').fetchall()
    head = ''.join('<th>%s%s</th>' % (name, ' [%s]' % unit if unit else '') for name, unit in COLUMNS)
    text = PAGE.read_text()
    for mark, value in (('@lead@', summary(database)), ('@head@', head),
                        ('@rows@', '\n'.join(page_row(database, one) for one in recordings))):
        text = text.replace(mark, value, 1)
    return text


def summary(database):
    """One sentence: how many recordings came to what."""
    counts = database.execute('SELECT state, count(*) AS n FROM recordings GROUP BY state ORDER BY state').fetchall()
    return '%d recordings: %s.' % (sum(c['n'] for c in counts), ', '.join('%d %s' % (c['n'], c['state']) for c in counts))


def open_database(path):
    database = sqlite3.connect(str(path))
    database.row_factory = sqlite3.Row
    return database


def write_whole(path, text):
    """Whole or not at all."""
    unfinished = path.with_name(path.name + '.part')
    unfinished.write_text(text)
    unfinished.replace(path)


def write(fleet, folder, snakemake_version):
    """Both whole or not at all."""
    unfinished = folder / 'fleet.sqlite.part'
    unfinished.unlink(missing_ok=True)
    database = open_database(unfinished)
    with database:
        fill(database, fleet, folder, snakemake_version)
    page_part = folder / 'index.html.part'
    page_part.write_text(fleet_page(database))
    database.close()
    unfinished.replace(folder / 'fleet.sqlite')
    page_part.replace(folder / 'index.html')
