/* The functions of CVODE (SUNDIALS 7) that model exchange uses, as addresses of a library that is loaded elsewhere. */
#ifndef VIBROIMPACT_CVODE_H
#define VIBROIMPACT_CVODE_H

#include <stdint.h>

typedef int (*vi_cvode_derivatives)(double time, void *states, void *derivatives, void *user);
typedef int (*vi_cvode_weights)(void *states, void *weights, void *user);
typedef int (*vi_cvode_roots)(double time, void *states, double *roots, void *user);
typedef void (*vi_cvode_message)(int line, const char *function, const char *file, const char *text, int code,
                                 void *user, void *context);

typedef struct {
    int (*create_context)(int, void **);
    int (*free_context)(void **);
    int (*clear_messages)(void *);
    int (*push_message)(void *, vi_cvode_message, void *);
    void *(*make_vector)(int64_t, double *, void *);
    double *(*vector_data)(void *);
    void (*free_vector)(void *);
    void *(*make_matrix)(int64_t, int64_t, void *);
    void (*free_matrix)(void *);
    void *(*make_linear)(void *, void *, void *);
    int (*free_linear)(void *);
    void *(*create)(int, void *);
    void (*free)(void **);
    int (*init)(void *, vi_cvode_derivatives, double, void *);
    int (*begin_anew)(void *, double, void *);
    int (*set_weights)(void *, vi_cvode_weights);
    int (*set_roots)(void *, int, vi_cvode_roots);
    int (*set_directions)(void *, int *);
    int (*roots_found)(void *, int *);
    int (*motion)(void *, double, int, void *);
    int (*set_linear)(void *, void *, void *);
    int (*set_user)(void *, void *);
    int (*set_stop)(void *, double);
    int (*set_longest)(void *, double);
    int (*no_root_warning)(void *);
    int (*set_warnings)(void *, int);
    int (*current_time)(void *, double *);
    int (*advance)(void *, double, void *, double *, int);
} vi_cvode;

#endif
