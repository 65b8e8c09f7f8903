"""Plots a field of a log over time.

    python3 plot_log.py session.rlog BALL.translation plot.png
"""
import sys

import matplotlib
matplotlib.use("Agg")  # no window
import matplotlib.pyplot as plt
import rtsg

table = rtsg.Log(sys.argv[1]).table(sys.argv[2])
plt.plot(table["time"], table[sys.argv[2]], label=["x", "y", "z"])
plt.xlabel("seconds")
plt.legend()
plt.savefig(sys.argv[3])
