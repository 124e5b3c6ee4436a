"""What a report's tables come to: partners, patches, events, statuses and timings of a recording, for the database."""
import collections
import concurrent.futures
import csv
import hashlib
import heapq
import json
import mmap
import pathlib

SLOWEST = 5


def rows(path):
    with open(path, newline='', errors='replace') as file:
        yield from csv.DictReader(file)


def digest(path):
    """In one call, which does not hold the interpreter: to get it back for each block would take longer than a block."""
    with open(path, 'rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        return hashlib.sha256(content).hexdigest()


def number(text):
    return float(text) if text else None


def of_report(folder):
    """Seconds are those after the recording's first step."""
    folder = pathlib.Path(folder)
    # The digest does not hold the interpreter.
    with concurrent.futures.ThreadPoolExecutor(1) as beside:
        contacts = beside.submit(digest, folder / 'contacts.csv')
        return {**of_tables(folder), 'contacts_sha256': contacts.result()}


def of_tables(folder):
    statuses, spans, origin = collections.Counter(), {}, None
    topology_changed = []
    for step in rows(folder / 'steps.csv'):
        statuses[step['status']] += 1
        start, stamp = int(step['start_ns']), int(step['stamp_ns'])
        if origin is None:
            origin = start if start > 0 else stamp
        if step['answered'] == '1':
            spans[step['step']] = ((start - origin) * 1e-9, (stamp - origin) * 1e-9)
        if step['status'] == 'TOPOLOGY_CHANGED':
            topology_changed.append(int(step['step']))
    partners, patches = {}, {}
    in_contact = collections.defaultdict(set)
    for row in rows(folder / 'patches.csv'):
        pair, (start, stamp) = (row['body_0'], row['body_1']), spans[row['step']]
        from_s = start + float(row['toc_lower']) * (stamp - start)
        partner = partners.setdefault(pair, {'body_0': pair[0], 'body_1': pair[1], 'first_s': from_s, 'in_contact_s': 0.0,
                                             'contacts': 0, 'patches': set()})
        partner['first_s'] = min(partner['first_s'], from_s)
        partner['contacts'] += int(row['contacts'])
        partner['patches'].add(int(row['patch']))
        if row['step'] not in in_contact[pair]:
            in_contact[pair] = {row['step']}  # rows of a step follow each other
            partner['in_contact_s'] += stamp - start
        patch = patches.setdefault(int(row['patch']), {
            'patch': int(row['patch']), 'body_0': pair[0], 'body_1': pair[1], 'beginning': row['beginning'], 'first_s': from_s,
            'last_s': stamp, 'steps': 0, 'contacts': 0, 'largest_m2': 0.0, 'expected': 1})
        patch['last_s'] = stamp
        patch['steps'] += 1
        patch['contacts'] += int(row['contacts'])
        patch['largest_m2'] = max(patch['largest_m2'], float(row['area_m2']))
        patch['expected'] = int(patch['expected'] and int(row['expected']) == int(row['contacts']) + int(row['crossings']))
    for partner in partners.values():
        partner['patches'] = len(partner['patches'])
    events, first_new = [], None
    for row in rows(folder / 'events.csv'):
        event = {'step': int(row['step']), 'event': row['event'], 'patch': int(row['patch']), 'others': row['others'],
                 'body_0': row['body_0'], 'body_1': row['body_1'], 'expected': int(row['expected']),
                 'earliest_s': number(row['earliest_s']), 'latest_s': number(row['latest_s'])}
        events.append(event)
        alarm = (row['event'] == 'BEGAN' and row['beginning'] == 'NEW' and row['expected'] == '0') or row['event'] == 'UNEXPECTED'
        if alarm and event['earliest_s'] is not None:
            first_new = min(event['earliest_s'], first_new if first_new is not None else event['earliest_s'])
    slowest = heapq.nlargest(SLOWEST, rows(folder / 'timing.csv'), key=lambda row: float(row['total_ms']))
    report = json.loads((folder / 'report.json').read_text(errors='replace'))
    frames, answered = sum(statuses.values()), len(spans)
    return {
        'frames': frames, 'answered': answered, 'unanswered_share': (frames - answered) / frames if frames else 1.0,
        'first_new_contact_s': first_new, 'duration_s': max((span[1] for span in spans.values()), default=0.0),
        'topology_changed': topology_changed, 'statuses': statuses, 'partners': list(partners.values()),
        'patches': list(patches.values()), 'events': events,
        'slowest': [{'step': int(row['step']), 'time_s': spans[row['step']][0], 'ms': float(row['total_ms'])} for row in slowest],
        'timings': [{'stage': stage['name'], 'median_ms': stage['median_ms'], 'p95_ms': stage['p95_ms']}
                    for stage in [*report['stages'], {'name': 'total', **report['total']}]]}
