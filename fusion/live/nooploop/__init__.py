"""Nooploop sensors: LinkTrack (UWB) and TOFSense (time of flight), from bytes to readings.

>>> from axialnav.fusion.live.nooploop.decoder import NLinkDecoder
>>> decoder = NLinkDecoder()
>>> [frame] = decoder.feed(bytes.fromhex("57 00 ff 00 c2 45 00 00 80 02 00 00 08 00 ff e6"))
>>> frame.distance_m
0.64
"""
