// Colours by daylight and by night.

const THEMES = {
  light: {
    skyline: "#f3f1ec", floor: "#fbf9f4", gridShade: 0.93, sky: [1.0, 1.02, 1.06], ground: [0.78, 0.74, 0.7],
    wire: "#1d1c1b", ink: "#2b2927", faint: "#6d6862", line: "#dcd7ce", accent: "#9c2f35",
  },
  dark: {
    skyline: "#17181c", floor: "#24262c", gridShade: 1.22, sky: [0.86, 0.92, 1.04], ground: [0.4, 0.39, 0.4],
    wire: "#0c0c0d", ink: "#efece6", faint: "#a19c95", line: "#3a3c43", accent: "#ef7f6f",
  },
};
for (const theme of Object.values(THEMES))
  for (const key of ["skyline", "floor", "wire"]) theme[key] = hex(theme[key]);
