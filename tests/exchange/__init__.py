"""Exchange of our FMUs with other tools: results of each tool compared with the dataset of the exported scene."""
