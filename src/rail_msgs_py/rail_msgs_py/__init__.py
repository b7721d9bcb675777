"""What is on the wire: typed views of standard messages, topic names, QoS and diagnostics.

The only package that knows message types, topic names and QoS profiles.
"""
