export * from "./endpoint";
export * from "./frame";
export * from "./messages";
