/* Calls of an FMU for model exchange in a loop, without the cost of a language between them. */
#include <stddef.h>
#include <stdint.h>

typedef int (*numbers_call)(void *instance, double values[], size_t count);
typedef int (*derivative_call2)(void *instance, const uint32_t unknowns[], size_t unknown_count, const uint32_t knowns[],
                                size_t known_count, const double seed[], double sensitivity[]);
typedef int (*derivative_call3)(void *instance, const uint32_t unknowns[], size_t unknown_count, const uint32_t knowns[],
                                size_t known_count, const double seed[], size_t seed_count, double sensitivity[],
                                size_t sensitivity_count);

/* Set the states and get their derivatives; the result is the worst status. */
int evaluations(numbers_call set, numbers_call get, void *instance, double states[], double derivatives[], size_t count,
                long calls)
{
    int worst = 0;
    for (long i = 0; i < calls; ++i) {
        worst |= set(instance, states, count) | get(instance, derivatives, count);
    }
    return worst;
}

int derivatives2(derivative_call2 call, void *instance, const uint32_t unknowns[], size_t unknown_count,
                 const uint32_t knowns[], size_t known_count, const double seed[], double sensitivity[], long calls)
{
    int worst = 0;
    for (long i = 0; i < calls; ++i) {
        worst |= call(instance, unknowns, unknown_count, knowns, known_count, seed, sensitivity);
    }
    return worst;
}

int derivatives3(derivative_call3 call, void *instance, const uint32_t unknowns[], size_t unknown_count,
                 const uint32_t knowns[], size_t known_count, const double seed[], double sensitivity[], long calls,
                 int adjoint)
{
    const size_t seeds = adjoint ? unknown_count : known_count, results = adjoint ? known_count : unknown_count;
    int worst = 0;
    for (long i = 0; i < calls; ++i) {
        worst |= call(instance, unknowns, unknown_count, knowns, known_count, seed, seeds, sensitivity, results);
    }
    return worst;
}
