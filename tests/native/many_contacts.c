/* The tests of structure.c and complementarity.c with 32 contacts, on a core compiled for a Structure. */
#define main with_random_bodies
#include "structure.c"
#undef main
#define main with_random_problems
#include "complementarity.c"
#undef main

_Static_assert(VI_PORTS == 32, "a core of a Structure");

int main(int count, char **names)
{
    return with_random_bodies(count, names) + with_random_problems();
}
