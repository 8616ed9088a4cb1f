/* The mass that calls back within each step. */
#include "model.h"

bool model_updates = true;

#include "mass.c"
