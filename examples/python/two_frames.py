#!/usr/bin/env python3
"""The contacts between two frames of a mesh: a strip of cloth whose end folds over and through its beginning."""
import numpy as np

import dccd

x, y = np.meshgrid(0.1 * np.arange(6), 0.1 * np.arange(2))
before = np.stack([x, y, np.zeros_like(x)], axis=2)
after = before.copy()
before[:, 4:] += [-0.08, 0.02, 0.1]
before[:, 5] -= [0.2, 0, 0]
after[:, 4:] = before[:, 4:] - [[[0, 0, 0.05], [0, 0, 0.2]]]

outcome = dccd.detect(dccd.Body(before.reshape(-1, 3), after.reshape(-1, 3), mesh=dccd.Mesh.grid(2, 6), name='cloth'))
for contact in outcome.contacts:
    print(dccd.KINDS[contact['kind']], *contact['vertices'], ' at %.9f' % contact['toc_lower'])
print('%d contacts, starts %s; %s' % (len(outcome.contacts), outcome.start_state, outcome))
