"""Face models behind one interface: `procedural` (embedded) and `ict` (ICT-FaceKit)."""
