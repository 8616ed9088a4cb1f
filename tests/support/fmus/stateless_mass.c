/* The mass without a state that can be saved: none of its steps can be repeated. */
#define HAS_STATE false
#include "mass.c"
