"""Our FMUs in other tools: what each makes of an export, against the dataset of the scene that it was made of."""
