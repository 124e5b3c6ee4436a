"""What happened in a scene, by its steps: first contacts, when it was clear; and what of its page does not hold."""
import collections

OCTOMAP, SELF = 'octomap', 'self'
# A contact: when [s]; whether the step began with it; what met: 'octomap', 'self' or a frozenset of two bodies' names.
StoryContact = collections.namedtuple('StoryContact', 'time_s initial what')
# A step between two frames [s]; `clear`: answered, nothing crosses at its start, and it has no contact.
StoryStep = collections.namedtuple('StoryStep', 'start_s end_s start_clear clear contacts')

# What became of a patch: 'BEGAN', 'ENDED', 'SPLIT', 'MERGED', 'UNEXPECTED'; its partners as above; identities; between which times
# [s] (None: unknown); how it began.
StoryEvent = collections.namedtuple('StoryEvent', 'kind what patch others earliest_s latest_s beginning')

Story = collections.namedtuple('Story', 'clear_until_s first_s new last_s clear_since_s share_clear')


def what_met(body_0, body_1):
    """Of a contact between these bodies, the second one None for the octomap."""
    if body_1 is None:
        return OCTOMAP
    return SELF if body_0 == body_1 else frozenset((body_0, body_1))


def tell(steps):
    """The story of steps in the order of time; times are None where there is no such moment."""
    clear = [step.clear for step in steps]
    touched = clear.index(False) if False in clear else len(steps)
    parted = len(steps) - clear[::-1].index(False) if False in clear else 0
    new = collections.defaultdict(list)
    for step in steps:
        for contact in step.contacts:
            if not contact.initial:
                new[contact.what].append(contact.time_s)
    times = [contact.time_s for step in steps for contact in step.contacts]
    return Story(clear_until_s=steps[touched - 1].end_s if touched else None,
                 first_s={what: min(found) for what, found in new.items()},
                 new={what: len(found) for what, found in new.items()},
                 last_s=max(times, default=None),
                 clear_since_s=steps[parted].start_s if parted < len(steps) else None,
                 share_clear=sum(step.start_clear for step in steps) / max(1, len(steps)))


def name_of(what):
    if what == OCTOMAP:
        return 'with the octomap'
    return 'of a body with itself' if what == SELF else 'of %s with %s' % tuple(sorted(what))


def lines(story):
    """The story as lines of text, seconds from the first frame."""
    moments = []
    if story.clear_until_s is not None:
        moments.append((story.clear_until_s, 'clear of everything until then'))
    moments += [(at, 'first contact ' + name_of(what)) for what, at in story.first_s.items()]
    if story.last_s is not None:
        moments.append((story.last_s, 'last contact'))
        if story.clear_since_s is not None:
            moments.append((story.clear_since_s, 'clear again since then'))
    # Of moments at the same time, the order in which they are told above.
    return ['%7.3f s  %s' % moment for moment in sorted(moments, key=lambda moment: moment[0])]


def none_expected(expected):
    return expected == 'none' or expected['first_contact_s'] == 'none'


def broken_contact(name, what, expected, story):
    first = story.first_s.get(what)
    if none_expected(expected):
        return [] if first is None else ['%s: a contact at %.4f s, where none is expected' % (name, first)]
    low, high = expected['first_contact_s']
    if first is None:
        return ['%s: no contact; the first one is expected from %g to %g s' % (name, low, high)]
    broken = []
    if not low <= first <= high:
        broken.append('%s: first contact at %.4f s, expected from %g to %g s' % (name, first, low, high))
    least = expected.get('contacts_at_least', 1)
    if story.new[what] < least:
        broken.append('%s: %d new contacts, expected at least %d' % (name, story.new[what], least))
    return broken


def broken_clear(expected, steps, story):
    broken = []
    until_s, again_s = expected.get('until_s'), expected.get('again_s')
    if until_s is not None:
        until = -1 if story.clear_until_s is None else story.clear_until_s
        first = min(story.first_s.values(), default=None)
        # Frames need not fall on until_s: the step that holds it may be the one of the first contact.
        early = [step for step in steps if step.end_s <= until_s and not step.clear]
        if early:
            broken.append('clear: the step from %.4f s is not clear, expected until %g s' % (early[0].start_s, until_s))
        elif first is not None and not until <= first <= next(s.end_s for s in steps if s.end_s > until):
            broken.append('clear: ends at %.4f s, and the first contact comes at %.4f s, not in the step after' % (
                until, first))
    if again_s is not None:
        since = story.clear_since_s
        if since is None or since > again_s:
            broken.append('clear: again %s, expected from %g s to the end' % (
                'never' if since is None else 'from %.4f s' % since, again_s))
    share = expected.get('share_at_least', 0)
    if story.share_clear < share:
        broken.append('clear: %.0f %% of the steps start clear, expected at least %.0f %%' % (
            100 * story.share_clear, 100 * share))
    return broken


def living_patches(events):
    """The identities that have not ended."""
    alive = set()
    for event in events:
        if event.kind in ('BEGAN', 'SPLIT'):
            alive.update([event.patch, *event.others])
        elif event.kind == 'MERGED':
            alive.difference_update(event.others)
        elif event.kind == 'ENDED':
            alive.discard(event.patch)
    return alive


def broken_patches(name, what, expected, events):
    """Begins with the first contact, and ends, or lasts, as the page says."""
    mine = [event for event in events if event.what == what]
    if none_expected(expected):
        return ['%s: patch %d, where none is expected' % (name, mine[0].patch)] if mine else []
    first = next((event for event in mine if event.kind == 'BEGAN' and event.beginning == 'NEW'), None)
    low, high = expected['first_contact_s']
    if first is None:
        return ['%s: no patch begins' % name]
    broken = []
    if not low <= first.earliest_s <= first.latest_s <= high + 1e-6:
        broken.append('%s: the first patch begins from %.4f to %.4f s, expected from %g to %g s' % (
            name, first.earliest_s, first.latest_s, low, high))
    alive = living_patches(mine)
    if expected.get('lasts') and not alive:
        broken.append('%s: no patch lasts to the end' % name)
    if 'ends_s' in expected:
        low, high = expected['ends_s']
        ends = [event.latest_s for event in mine if event.kind == 'ENDED' and event.latest_s is not None]
        if alive or not ends or not low <= max(ends) <= high:
            broken.append('%s: %s, expected to have ended from %g to %g s' % (
                name, 'patches %s last' % sorted(alive) if alive else 'the last patch ends at %s s' % max(ends, default=None), low, high))
    return broken


def unknown_words(name, fact, bodies):
    """What of a fact nobody reads, each a line: a word that is none, a name that no body has."""
    words = {'until_s', 'again_s', 'share_at_least'} if name == 'clear' else {'first_contact_s', 'contacts_at_least', 'ends_s', 'lasts'}
    if name == 'body':
        words.add('names')
    if name not in (OCTOMAP, SELF, 'body', 'clear'):
        return ['%s: no such fact' % name]
    found = [] if fact == 'none' else ['%s: %s is not known' % (name, word) for word in sorted(set(fact) - words)]
    return found + ['%s: nobody is called %s' % (name, one) for one in fact['names'] if one not in bodies] if 'names' in fact else found


def broken_facts(expect, steps, bodies, events=None):
    """Of a scene's `expect` block, the facts that do not hold of these steps, between bodies of these names, and, where given,
    of the patches' events, each a line; none when all hold."""
    if not steps:
        return ['no step was answered']
    story, broken = tell(steps), []
    for name, expected in expect.items():
        for one in expected if isinstance(expected, list) else [expected]:
            unknown = unknown_words(name, one, bodies)
            broken += unknown
            if unknown:
                continue
            if name == 'clear':
                broken += broken_clear(one, steps, story)
                continue
            what = frozenset(one['names']) if name == 'body' else name
            broken += broken_contact(name, what, one, story)
            if events is not None:
                broken += broken_patches(name, what, one, events)
    return broken
