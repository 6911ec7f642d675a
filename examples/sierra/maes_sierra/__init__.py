"""SIERRA plug-ins: MAES as an engine (`simulator`), a project that compares controllers
(`exploration`), and the comparison itself (`comparison`)."""
