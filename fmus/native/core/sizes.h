/* The largest bodies that a library is compiled for; a component's variables.toml says its own. */
#ifndef VIBROIMPACT_SIZES_H
#define VIBROIMPACT_SIZES_H

#ifndef VI_MODES
#define VI_MODES 64 /* modes of a structure */
#endif
#ifndef VI_PORTS
#define VI_PORTS 8 /* contacts of a structure */
#endif
#ifndef VI_ONLY_MODES
#define VI_ONLY_MODES 0 /* the one number of modes that its bodies have, which costs no loops then; 0: any up to VI_MODES */
#endif

#endif
