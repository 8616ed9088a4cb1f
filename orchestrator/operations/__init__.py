"""Operations of this package, one declaration a file: see `vibroimpact.fmus.operations`."""
