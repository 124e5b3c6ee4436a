#!/usr/bin/env python3
"""Who touched whom in a recording, and when first: reads the tables of a report with pandas.

usage: read_tables.py REPORT        the folder that analyze_bag --report made; doc/tools.md explains its columns
"""
import pathlib
import sys

import pandas

report = pathlib.Path(sys.argv[1])
contacts = pandas.read_csv(report / 'contacts.csv')
steps = pandas.read_csv(report / 'steps.csv')
print('%d of %d steps are clear' % (steps['clear'].sum(), len(steps)))
print(contacts.groupby(['body_0', 'body_1']).agg(contacts=('step', 'size'), steps=('step', 'nunique'), first_s=('time_s', 'min')))
