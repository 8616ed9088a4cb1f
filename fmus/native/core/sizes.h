/* Largest sizes of bodies in a library; each component's variables.toml sets its own. */
#ifndef VIBROIMPACT_SIZES_H
#define VIBROIMPACT_SIZES_H

#ifndef VI_MODES
#define VI_MODES 64 /* modes of a structure */
#endif
#ifndef VI_PORTS
#define VI_PORTS 8 /* contacts of a structure */
#endif
#ifndef VI_STOPS_MOVE
#define VI_STOPS_MOVE 0 /* may stops move? Their motions are modes behind those of the bodies */
#endif
#ifndef VI_ONLY_MODES
#define VI_ONLY_MODES 0 /* number of modes that all bodies have, known to the compiler; 0: any up to VI_MODES */
#endif
#ifndef VI_GROWING
#define VI_GROWING 1 /* may modes have negative stiffness or damping? */
#endif
#ifndef VI_SINES
#define VI_SINES 0 /* sines of the forcing besides the clock's */
#endif
#ifndef VI_SIGNALS
#define VI_SIGNALS 0 /* signals of time among the loads */
#endif
#ifndef VI_DEGREE
#define VI_DEGREE 1 /* degree of the polynomials in time that inputs are on a segment, >= 1 */
#endif

/* A function that few instances call: compilers keep it small. */
#if defined(__GNUC__) || defined(__clang__)
#define VI_RARE __attribute__((cold))
#else
#define VI_RARE
#endif

/* Rooms of arrays that may be unused: C has no empty arrays. */
enum {
    VI_SINES_ROOM = VI_SINES > 0 ? VI_SINES : 1,
    VI_SIGNALS_ROOM = VI_SIGNALS > 0 ? VI_SIGNALS : 1,
    VI_LOADS_ROOM = VI_SIGNALS > 0 ? VI_MODES : 1,
    VI_HIGHER_ROOM = VI_DEGREE > 1 ? VI_DEGREE - 1 : 1
};

#endif
