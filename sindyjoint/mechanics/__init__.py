"""What makes motion: joint laws, excitations, exact stick–slip simulation, virtual tests and structures.

Nothing here knows how laws are discovered; a recovered law is simulated through the protocol of
:class:`sindyjoint.mechanics.laws.Law`.
"""
