/* merl.h - a MERL file of an analytic material, computed by the client itself. */
#ifndef CLIENT_MERL_H
#define CLIENT_MERL_H

#include <jansson.h>
#include <stddef.h>

/*
 * {"dims":[90,90,180],"bytes":n} and {"value":x}: one number throughout; or {"alpha":a,"f0":[r,g,b]}:
 * GGX with height-correlated Smith masking and Schlick's Fresnel term, -1 below the horizon.
 */
char *merl_make(const json_t *from, size_t *size);

#endif
