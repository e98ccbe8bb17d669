"""The command line: parse, call one workflow of `multimedia`, print."""
